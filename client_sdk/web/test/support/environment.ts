/** Defined by scripts/test.mjs when it bundles a test. */
declare const STRIDEWIRE_ROOT: string;

/** Path of the repository, with a slash at the end. */
export const root = STRIDEWIRE_ROOT;

/** Returns an environment variable as a non-negative integer, or `otherwise` if it is not set. */
export function numberFrom(name: string, otherwise: number): number {
  const value = process.env[name];
  if (value === undefined || value === '') return otherwise;
  if (!/^\d+$/.test(value)) {
    throw new Error(`${name}: expected a non-negative integer, got ${value}`);
  }
  return Number(value);
}
