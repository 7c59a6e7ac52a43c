/** Written in by scripts/test.mjs. */
declare const STRIDEWIRE_ROOT: string;

/** The project's folder, ended by a slash. */
export const root = STRIDEWIRE_ROOT;

/** A whole number from the environment. */
export function numberFrom(name: string, otherwise: number): number {
  const value = process.env[name];
  if (value === undefined || value === '') return otherwise;
  if (!/^\d+$/.test(value)) throw new Error(`${name} is no number: ${value}`);
  return Number(value);
}
