/** Functions that the generated code calls to check values that the user has passed. They throw an
 * Error with the path of the value. */

export type Fields = {readonly [name: string]: unknown};

/** Path of a property and, in a list, the index in the outermost one: "items.avatar[3]". */
export class Place {
  constructor(private readonly path: string, private readonly index = -1) {}

  of(name: string): Place {
    return new Place(this.path === '' ? name : `${this.path}.${name}`, this.index);
  }

  entry(i: number): Place {
    return this.index < 0 ? new Place(this.path, i) : this;
  }

  fail(what: string): never {
    throw new Error(`${this.path}${this.index < 0 ? '' : `[${this.index}]`}: ${what}`);
  }
}

export function object(value: unknown, at: Place): Fields {
  return value !== null && typeof value === 'object' ? value as Fields
                                                     : at.fail('expected an object');
}

export function list<T, U = unknown>(value: unknown, at: Place,
                                     check: (entry: U, at: Place) => T): T[] {
  const list = value as ArrayLike<U> | null;
  if (typeof list !== 'object' || typeof list?.length !== 'number') at.fail('expected a list');
  return Array.from(list!, (entry, i) => check(entry, at.entry(i)));
}

export function tuple(value: unknown, at: Place, count: number): readonly unknown[] {
  const members = value as readonly unknown[] | null | undefined;
  return members?.length === count ? members : at.fail(`expected ${count} numbers`);
}

export function oneOf(value: unknown, at: Place, names: readonly string[]): number {
  const number = names.indexOf(value as string);
  return number >= 0 ? number : at.fail(`expected one of ${names.join(', ')}, got ${value}`);
}

export function truth(value: unknown, at: Place): boolean {
  return typeof value === 'boolean' ? value : at.fail('expected true or false');
}

/** Checks a flag that the message does not use: false or absent. `why` is the error text. */
export function unused(value: unknown, at: Place, why: string): null {
  return (value ?? false) === false ? null : at.fail(why);
}

export function text(value: unknown, at: Place): string {
  if (typeof value !== 'string') return at.fail('expected a string');
  return /\p{Surrogate}/u.test(value) ? at.fail('contains lone surrogates') : value;
}

export function integer(value: unknown, at: Place, least: number, most: number): number {
  return typeof value === 'number' && Number.isInteger(value) && value >= least && value <= most
      ? value : at.fail(`expected an integer from ${least} to ${most}, got ${value}`);
}

export function long(value: unknown, at: Place): bigint {
  const integer = Number.isSafeInteger(value) ? BigInt(value as number) : value;
  return typeof integer === 'bigint' && integer >= 0n && integer < 2n ** 64n
      ? integer : at.fail(`expected a bigint or a safe integer of at least 0, got ${value}`);
}

export function real(value: unknown, at: Place): number {
  return typeof value === 'number' && Number.isFinite(value)
      ? value : at.fail(`expected a finite number, got ${value}`);
}
