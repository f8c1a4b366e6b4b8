// SPEC.md, "Codec 6: awt": codec 2 in all that a reader does.

export { open } from "./mrdwt.js";

export const id = 6;
export const name = "awt";
export const version = 0;
