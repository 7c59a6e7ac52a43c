/** Bytes that do not follow the standard, or a message to send that would not. Stays inside the
 * package: whoever reads frames or checks arguments catches it. */
export class Malformed extends Error {
  constructor(what: string, readonly field: string, readonly index = -1) {
    super(index < 0 ? `${field}: ${what}` : `${field}[${index}]: ${what}`);
  }
}
