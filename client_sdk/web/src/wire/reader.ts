import type {Parameters} from '../types';
import {Malformed} from './malformed';
import {parametersOf, type Fail} from './rules';
import {readText} from './text';

type NumberArray = Uint8Array | Uint16Array | Uint32Array | Float32Array | Float64Array;
type Read<T> = (reader: Reader, at: number) => T;

/**
 * Reads the fields of a verified message, for the generated decoders. A position of 0 means that a
 * field is absent. Each method throws Malformed if the value breaks its bounds.
 */
export class Reader {
  /** Names of the open tables, for errors. */
  private readonly path: string[];
  /** Index of the outermost list entry that is being read. */
  private index = -1;

  constructor(private readonly view: DataView, message: string) {
    this.path = [message];
  }

  readonly fail: Fail = (what, name, index = -1) => {
    throw new Malformed(what, [...this.path, ...(name === '' ? [] : [name])].join('.'),
                        this.index < 0 ? index : this.index);
  };

  /** Returns the position of field `slot` of the table at `at`. */
  at(at: number, slot: number): number {
    if (at === 0) return 0;
    const vtable = at - this.view.getInt32(at, true);
    const entry = 4 + 2 * slot;
    if (entry >= this.view.getUint16(vtable, true)) return 0;
    const offset = this.view.getUint16(vtable + entry, true);
    return offset === 0 ? 0 : at + offset;
  }

  follow(at: number): number {
    return at === 0 ? 0 : at + this.view.getUint32(at, true);
  }

  // ---- numbers

  bool(at: number): boolean {
    return at !== 0 && this.view.getUint8(at) !== 0;
  }
  ubyte(at: number, absent: number): number {
    return at === 0 ? absent : this.view.getUint8(at);
  }
  short(at: number, absent: number): number {
    return at === 0 ? absent : this.view.getInt16(at, true);
  }
  ushort(at: number, absent: number): number {
    return at === 0 ? absent : this.view.getUint16(at, true);
  }
  uint(at: number, absent: number): number {
    return at === 0 ? absent : this.view.getUint32(at, true);
  }
  ulong(at: number): bigint {
    return at === 0 ? 0n : this.view.getBigUint64(at, true);
  }
  float(at: number, absent: number): number {
    return at === 0 ? absent : this.view.getFloat32(at, true);
  }
  double(at: number, absent: number): number {
    return at === 0 ? absent : this.view.getFloat64(at, true);
  }

  finite(value: number, name: string): number {
    return Number.isFinite(value) ? value : this.fail('expected a finite number', name);
  }
  nonzero<T extends number | bigint>(value: T, name: string): T {
    return value == 0 ? this.fail('expected a number other than 0', name) : value;
  }
  within(value: number, name: string, min: number, max: number): number {
    if (value >= min && value <= max) return value;
    const range = max === Number.MAX_VALUE ? `of at least ${min}` : `from ${min} to ${max}`;
    return this.fail(`expected a number ${range}, got ${value}`, name);
  }
  above(value: number, name: string, bound: number): number {
    if (value > bound && value <= Number.MAX_VALUE) return value;
    return this.fail(`expected a number above ${bound}, got ${value}`, name);
  }
  known<T extends string>(value: number, values: readonly T[], last: number, name: string): T {
    return value <= last ? values[value]! : this.fail(`enumerator ${value} is unknown`, name);
  }

  vector2(at: number, name: string, type: 'float' | 'double'): [number, number] {
    return [this.component(at, name, type, 0), this.component(at, name, type, 1)];
  }
  vector3(at: number, name: string, type: 'float' | 'double'): [number, number, number] {
    return [...this.vector2(at, name, type), this.component(at, name, type, 2)];
  }
  vector4(at: number, name: string, type: 'float' | 'double'): [number, number, number, number] {
    return [...this.vector3(at, name, type), this.component(at, name, type, 3)];
  }
  private component(at: number, name: string, type: 'float' | 'double', i: number): number {
    if (at === 0) return 0;
    return this.finite(type === 'float' ? this.view.getFloat32(at + 4 * i, true)
                                        : this.view.getFloat64(at + 8 * i, true), name);
  }

  // ---- texts, lists and tables

  private count(at: number, name: string, min: number, max: number): number {
    const count = at === 0 ? 0 : this.view.getUint32(at, true);
    if (count >= min && count <= max) return count;
    return this.fail(`expected a length from ${min} to ${max}, got ${count}`, name);
  }

  text(field: number, name: string, min: number, max: number): string {
    const at = this.follow(field);
    const bytes = this.count(at, name, min, max);
    return bytes === 0 ? '' : readText(
        new Uint8Array(this.view.buffer as ArrayBuffer, this.view.byteOffset + at + 4, bytes),
        (what) => this.fail(what, name));
  }

  /**
   * Returns a list as a typed array, which shares the memory of the frame. Fails unless the list
   * has `min` to `max` numbers and each of them passes `check`.
   */
  numbers<T extends NumberArray>(
      field: number, name: string, min: number, max: number,
      type: new (buffer: ArrayBuffer, at: number, length: number) => T,
      check: 'finite' | 'nonzero' | null): T {
    const at = this.follow(field);
    const length = this.count(at, name, min, max);
    if (length === 0) return new type(new ArrayBuffer(0), 0, 0);
    const list = new type(this.view.buffer as ArrayBuffer, this.view.byteOffset + at + 4, length);
    if (check === null) return list;
    for (let i = 0; i < length; ++i) {
      const value = list[i]!;
      if (check === 'nonzero' ? value === 0 : !Number.isFinite(value)) {
        this.fail(`entry ${value} is not ${check}`, name, i);
      }
    }
    return list;
  }

  knownList<T extends string>(field: number, name: string, min: number, max: number,
                              values: readonly T[]): T[] {
    return Array.from(this.numbers(field, name, min, max, Uint8Array, null),
                      (value) => this.known(value, values, values.length - 1, name));
  }

  /** Reads a list of structs of `size` bytes, or of tables if `size` is 0. */
  list<T>(field: number, name: string, min: number, max: number, size: number, read: Read<T>): T[] {
    const at = this.follow(field);
    const length = this.count(at, name, min, max);
    const outermost = this.index < 0;
    this.path.push(name);
    const list: T[] = [];
    for (let i = 0; i < length; ++i) {
      if (outermost) this.index = i;
      list.push(read(this, size === 0 ? this.follow(at + 4 + 4 * i) : at + 4 + size * i));
    }
    if (outermost) this.index = -1;
    this.path.pop();
    return list;
  }

  parameters(field: number, name: string, min: number, max: number): Parameters {
    const at = this.follow(field);
    if (at === 0) return {};
    const list = Array.from({length: this.count(at, name, min, max)}, (_, i) => ({
      name: this.view.getUint8(at + 12 + 16 * i),
      value: this.finite(this.view.getFloat64(at + 4 + 16 * i, true), name),
    }));
    return parametersOf(list, (what) => this.fail(what, name));
  }

  /** Reads a table. All fields of an absent table are absent. */
  child<T>(field: number, name: string, read: Read<T>): T {
    this.path.push(name);
    const value = read(this, this.follow(field));
    this.path.pop();
    return value;
  }
  optional<T>(field: number, name: string, read: Read<T>): T | null {
    return field === 0 ? null : this.child(field, name, read);
  }

  checked<T>(message: T, rule: (message: T, fail: Fail) => void): T {
    rule(message, this.fail);
    return message;
  }
}
