// A stub: the strips come from elsewhere.

export function mountStrips() {}
