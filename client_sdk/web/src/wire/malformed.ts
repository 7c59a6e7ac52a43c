/**
 * Thrown if a received frame does not follow protocol/STANDARD.md, or an argument of the user
 * cannot be sent. This error does not leave the package: the session catches it.
 */
export class Malformed extends Error {
  constructor(what: string, readonly field: string, readonly index = -1) {
    super(index < 0 ? `${field}: ${what}` : `${field}[${index}]: ${what}`);
  }
}
