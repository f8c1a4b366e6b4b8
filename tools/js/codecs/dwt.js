// SPEC.md, "Codec 5: dwt": codec 2 in all that a reader does.

export { open } from "./mrdwt.js";

export const id = 5;
export const name = "dwt";
export const version = 0;
