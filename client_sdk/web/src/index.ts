/** Stridewire in a browser. */
export const protocolVersion = 1;
