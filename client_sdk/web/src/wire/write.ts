import {Builder} from 'flatbuffers';
import {MessageType, type MessageName} from '../../generated/messages';
import {tableNumbers, tables, type FieldInfo, type TableInfo} from '../../generated/tables';
import {Malformed} from './malformed';
import {parameterList} from './parameters';
import {frameHeaderBytes, isUsed} from './read';

type Fields = {readonly [name: string]: unknown};
/** A message whose values have not been checked. */
export type Draft = Fields & {readonly type: MessageName};

const builder = new Builder(1024);
const magic = 0x1a505753;  // "SWP", 0x1a
const frameVersion = 1;

/**
 * Writes a message as a frame. Properties may be absent if the schema states a default. Absent
 * `seq`, `world` and `subscription` are written as 1, because the WebAssembly module sets them in
 * commands.
 * @throws Malformed a value has the wrong type, or does not fit into the type of its field. The
 *     WebAssembly module checks everything else.
 */
export function writeMessage(message: Draft): Uint8Array<ArrayBuffer> {
  const table = tables[tableNumbers[message.type]]!;
  const fields = {seq: 1, world: 1, subscription: 1, ...message};
  checkFields(table, fields, '', -1);
  builder.clear();
  builder.finish(buildTable(builder, table, fields));
  const payload = builder.asUint8Array();
  const bytes = Math.ceil(payload.length / 8) * 8;
  const frame = new Uint8Array(frameHeaderBytes + bytes);
  const view = new DataView(frame.buffer);
  view.setUint32(0, magic, true);
  view.setUint16(4, frameVersion, true);
  view.setUint16(6, MessageType[message.type], true);
  view.setUint32(8, bytes, true);
  frame.set(payload, frameHeaderBytes);
  return frame;
}

// ---- types of values

const ranges: {readonly [type: string]: readonly [number, number]} = {
  ubyte: [0, 0xff], short: [-0x8000, 0x7fff], ushort: [0, 0xffff], uint: [0, 0xffff_ffff],
};

function checkFields(info: TableInfo, value: Fields, path: string, index: number): void {
  if (value === null || typeof value !== 'object') fail('expected an object', path, index);
  for (const field of info.fields) {
    const at = path === '' ? field.name : `${path}.${field.name}`;
    if (isUsed(info, field, value)) {
      if (!field.deprecated) checkField(field, given(field, value), at, index);
    } else if (field.type === 'bool' && (value[field.name] ?? false) !== false) {
      fail(field.only!.includes(value['type'] as string)
          ? `cannot be combined with ${field.without}`
          : `is only allowed for the types ${field.only!.join(', ')}`, at, index);
    }
  }
}

/** Returns the value of a field. If the property is absent, returns its default value. */
function given(field: FieldInfo, fields: Fields): unknown {
  const value = fields[field.name];
  if (value !== undefined || !field.absent) return value;
  if (field.list) return [];
  if (field.type === 'bool') return false;
  if (field.optional || field.initial === null) return null;
  return field.values === undefined ? field.initial : field.values[field.initial!];
}

function checkField(field: FieldInfo, value: unknown, path: string, index: number): void {
  const info = field.table === undefined ? undefined : tables[field.table]!;
  if (field.list) {
    if (field.parameters) return;
    if (value === null || typeof value !== 'object' ||
        typeof (value as unknown[]).length !== 'number') {
      fail('expected a list', path, index);
    }
    const list = value as ArrayLike<unknown>;
    for (let i = 0; i < list.length; ++i) {
      checkEntry(field, info, list[i], path, index < 0 ? i : index);
    }
    return;
  }
  if (value === null && (field.optional || field.initial === null)) return;
  checkEntry(field, info, value, path, index);
}

function checkEntry(field: FieldInfo, info: TableInfo | undefined, value: unknown, path: string,
                    index: number): void {
  if (info?.tuple) {
    const list = value as ArrayLike<unknown> | undefined;
    if (list?.length !== info.fields.length) {
      fail(`expected ${info.fields.length} numbers`, path, index);
    }
    info.fields.forEach((part, i) => checkNumber(part, list[i], path, index));
  } else if (info?.alone) {
    checkField(info.fields[0]!, value, path, index);
  } else if (info !== undefined) {
    checkFields(info, value as Fields, path, index);
  } else if (field.values !== undefined) {
    if (!field.values.includes(value as string)) {
      fail(`expected one of ${field.values.join(', ')}, got ${value}`, path, index);
    }
  } else if (field.type === 'bool') {
    if (typeof value !== 'boolean') fail('expected true or false', path, index);
  } else if (field.type === 'string') {
    if (typeof value !== 'string') fail('expected a string', path, index);
    if (/\p{Surrogate}/u.test(value)) fail('contains lone surrogates', path, index);
  } else {
    checkNumber(field, value, path, index);
  }
}

function checkNumber({type}: FieldInfo, value: unknown, path: string, index: number): void {
  if (type === 'ulong') {
    const isSafe = typeof value === 'number' && Number.isSafeInteger(value);
    const integer = isSafe ? BigInt(value) : value;
    if (typeof integer !== 'bigint' || integer < 0n || integer >= 2n ** 64n) {
      fail(`expected a bigint or a safe integer of at least 0, got ${value}`, path, index);
    }
  } else if (type === 'float' || type === 'double') {
    if (typeof value !== 'number' || !Number.isFinite(value)) {
      fail(`expected a finite number, got ${value}`, path, index);
    }
  } else {
    const [least, most] = ranges[type]!;
    if (typeof value !== 'number' || !Number.isInteger(value) || value < least || value > most) {
      fail(`expected an integer from ${least} to ${most}, got ${value}`, path, index);
    }
  }
}

function fail(what: string, path: string, index: number): never {
  throw new Malformed(index < 0 ? `${path}: ${what}` : `${path}[${index}]: ${what}`);
}

// ---- bytes

const writers: {readonly [type: string]: (b: Builder, value: never) => void} = {
  bool: (b, value: boolean) => b.writeInt8(value ? 1 : 0),
  ubyte: (b, value: number) => b.writeInt8(value),
  short: (b, value: number) => b.writeInt16(value),
  ushort: (b, value: number) => b.writeInt16(value),
  uint: (b, value: number) => b.writeInt32(value),
  float: (b, value: number) => b.writeFloat32(value),
  double: (b, value: number) => b.writeFloat64(value),
  ulong: (b, value: number | bigint) => b.writeInt64(BigInt(value)),
};

/** Converts a property to the number that is stored. */
function stored(value: unknown, field: FieldInfo): never {
  if (field.values !== undefined) return field.values.indexOf(value as string) as never;
  return (field.inverted ? !value : value) as never;
}

function writeScalar(b: Builder, value: unknown, field: FieldInfo, type = field.type): void {
  writers[type]!(b, stored(value, field));
}

/** Writes a struct backwards, as FlatBuffers does, and returns its position. */
function writeStruct(b: Builder, info: TableInfo, value: unknown): number {
  const [size, align] = info.struct!;
  b.prep(align, size);
  writeFields(b, info, value, size);
  return b.offset();
}

function writeFields(b: Builder, info: TableInfo, value: unknown, size: number): void {
  let end = size;
  for (let i = info.fields.length - 1; i >= 0; --i) {
    const field = info.fields[i]!;
    const member = info.tuple ? (value as number[])[i] : (value as Fields)[field.name];
    b.pad(end - field.at! - field.layout[1]);
    if (field.table === undefined) writeScalar(b, member, field);
    else writeFields(b, tables[field.table]!, member, field.layout[1]);
    end = field.at!;
  }
}

/** Builds the list, text or table to which a field refers. Returns its offset; 0 if it is absent or
 * stored inline. */
function buildTarget(b: Builder, field: FieldInfo, value: unknown): number {
  if (field.list) return buildList(b, field, isList(value) ? value : parameterList(value as never));
  if (field.type === 'string') {
    if (value === '') return 0;
    return field.shared ? b.createSharedString(value as string) : b.createString(value as string);
  }
  const info = field.table === undefined ? undefined : tables[field.table]!;
  return info === undefined || info.struct !== undefined || value === null ? 0
      : buildTable(b, info, value as Fields);
}

function isList(value: unknown): value is ArrayLike<unknown> {
  return Array.isArray(value) || ArrayBuffer.isView(value);
}

function buildList(b: Builder, field: FieldInfo, list: ArrayLike<unknown>): number {
  if (list.length === 0) return 0;
  const info = field.table === undefined ? undefined : tables[field.table]!;
  const [, size, align] = field.layout;
  if (info === undefined || info.struct !== undefined) {
    b.startVector(size, list.length, align);
    for (let i = list.length - 1; i >= 0; --i) {
      if (info === undefined) writeScalar(b, list[i], field);
      else writeStruct(b, info, list[i]);
    }
    return b.endVector();
  }
  const entries = Array.from(list, (entry) => buildTable(
      b, info, (info.alone ? {[info.fields[0]!.name]: entry} : entry) as Fields));
  b.startVector(4, entries.length, 4);
  for (let i = entries.length - 1; i >= 0; --i) b.addOffset(entries[i]!);
  return b.endVector();
}

function buildTable(b: Builder, info: TableInfo, m: Fields): number {
  const values = info.fields.map((field) =>
      field.deprecated || !isUsed(info, field, m) ? null : given(field, m));
  const targets = info.fields.map((field, slot) =>
      values[slot] === null ? 0 : buildTarget(b, field, values[slot]));
  b.startObject(info.fields.length);
  info.fields.forEach((field, slot) => {
    const value = values[slot];
    if (value === null) return;
    if (targets[slot] !== 0) {
      b.addFieldOffset(slot, targets[slot]!, 0);
    } else if (field.table !== undefined && tables[field.table]!.struct && !field.list) {
      b.addFieldStruct(slot, writeStruct(b, tables[field.table]!, value), 0);
    } else if (field.initial !== undefined && Number(stored(value, field)) !== field.initial) {
      // Readers use `initial` for an absent number. If `initial` is null, every number is stored.
      b.prep(field.layout[1], 0);
      writeScalar(b, value, field);
      b.slot(slot);
    }
  });
  return b.endObject();
}
