// What a decoder may throw. Nothing else leaves `decode()` or `sources()`.

/** Any reason not to give what was asked for; `exitCode` is that of the conformance contract. */
export class MczError extends Error {
  constructor(message) {
    super(message);
    this.name = this.constructor.name;
  }

  get exitCode() {
    return 1;
  }
}

/** The file (or the request) breaks a statement of SPEC.md. */
export class Refused extends MczError {}

/** A number is beyond a limit of SPEC.md, "Limits and profiles". */
export class LimitExceeded extends Refused {}

/** The bytes of a file could not be had: its server, or what holds them, did not give them. */
export class AccessError extends MczError {}

/** The file may be right, but needs something that this decoder does not have. */
export class Unsupported extends MczError {
  get exitCode() {
    return 3;
  }
}
