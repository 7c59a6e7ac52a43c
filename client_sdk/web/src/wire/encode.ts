import {Builder} from 'flatbuffers';
import {maxBulkBytes, maxControlBytes} from '../../generated/limits';
import type {Message} from '../../generated/messages';
import {tableNumbers, tables, type FieldInfo, type TableInfo} from '../../generated/tables';
import {makeFrame, maxPayloadBytes} from './frame';
import {Malformed} from './malformed';
import {parameterList} from './rules';

/** Encodes valid messages as frames. The constructor takes the size limits of the server. */
export class Encoder {
  private readonly builder = new Builder(1024);

  constructor(private readonly controlBytes = maxControlBytes,
              private readonly bulkBytes = maxBulkBytes) {}

  /** @throws Malformed the message exceeds the limit of the server */
  encode(message: Message): ArrayBuffer {
    const b = this.builder;
    b.clear();
    b.finish(buildTable(b, tables[tableNumbers[message.type]]!, message as never));
    const bytes = b.asUint8Array();
    if (bytes.length > maxPayloadBytes(message.type, this.controlBytes, this.bulkBytes)) {
      throw new Malformed(`${bytes.length} bytes exceed the limit of the server`, message.type);
    }
    return makeFrame(message.type, bytes);
  }
}

type Fields = {readonly [name: string]: unknown};

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

/** Builds what a field refers to. Returns its offset; 0 if it is absent or stored inline. */
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
  const targets = info.fields.map((field) =>
      field.deprecated ? 0 : buildTarget(b, field, m[field.name]));
  b.startObject(info.fields.length);
  info.fields.forEach((field, slot) => {
    const value = m[field.name];
    if (field.deprecated || value === null) return;
    if (targets[slot] !== 0) {
      b.addFieldOffset(slot, targets[slot]!, 0);
    } else if (field.table !== undefined && tables[field.table]!.struct && !field.list) {
      b.addFieldStruct(slot, writeStruct(b, tables[field.table]!, value), 0);
    } else if (field.initial !== undefined && Number(stored(value, field)) !== field.initial) {
      // An absent number has the value `initial`; if that is null, every number is stored.
      b.prep(field.layout[1], 0);
      writeScalar(b, value, field);
      b.slot(slot);
    }
  });
  return b.endObject();
}
