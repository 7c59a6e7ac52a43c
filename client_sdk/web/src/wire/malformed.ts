/** Thrown if a message cannot be sent, or a frame is invalid. It does not leave the package. */
export class Malformed extends Error {}
