import {MessageType, type Message, type MessageName} from '../../generated/messages';
import {tableNumbers, tables, type FieldInfo, type TableInfo} from '../../generated/tables';
import {parametersOf} from './parameters';

const names = new Map<number, MessageName>(
    Object.entries(MessageType).map(([name, type]) => [type, name as MessageName]));

export const frameHeaderBytes = 16;

/** Returns the type number of the message in a frame. */
export function typeOfFrame(frame: ArrayBuffer): number {
  return frame.byteLength < frameHeaderBytes ? 0 : new DataView(frame).getUint16(6, true);
}

/** Reads a message from a frame that the WebAssembly module has accepted: this function checks
 * nothing. Lists of numbers are views of the frame. */
export function readMessage(frame: ArrayBuffer): Message {
  const name = names.get(typeOfFrame(frame))!;
  const view = new DataView(frame, frameHeaderBytes);
  const table = tables[tableNumbers[name]]!;
  return {type: name, ...readTable(view, view.getUint32(0, true), table) as object} as Message;
}

const arrays = {
  ubyte: Uint8Array, ushort: Uint16Array, uint: Uint32Array, float: Float32Array,
  double: Float64Array,
} as const;

const decoder = new TextDecoder('utf-8', {ignoreBOM: true});

/** Returns the position of field `slot` of the table at `at`; 0 if it is absent. */
function fieldAt(view: DataView, at: number, slot: number): number {
  if (at === 0) return 0;
  const vtable = at - view.getInt32(at, true);
  const entry = 4 + 2 * slot;
  if (entry >= view.getUint16(vtable, true)) return 0;
  const offset = view.getUint16(vtable + entry, true);
  return offset === 0 ? 0 : at + offset;
}

function follow(view: DataView, at: number): number {
  return at === 0 ? 0 : at + view.getUint32(at, true);
}

/** Reads the table at `at`. If `at` is 0, the table is absent, and so are all of its fields. */
function readTable(view: DataView, at: number, info: TableInfo): unknown {
  if (info.alone) return readField(view, fieldAt(view, at, 0), info.fields[0]!);
  const table: {[name: string]: unknown} = {};
  info.fields.forEach((field, slot) => {
    if (!field.deprecated) table[field.name] = readField(view, fieldAt(view, at, slot), field);
  });
  for (const field of info.fields) {
    if (isUsed(info, field, table)) continue;
    table[field.name] = field.type === 'bool' ? false : readField(view, 0, field);
  }
  return table;
}

/** Returns false if a field has no meaning in this message. The module does not check its value. */
export function isUsed(info: TableInfo, {only, with: needed, without}: FieldInfo,
                       table: {readonly [name: string]: unknown}): boolean {
  const has = (name: string): boolean => Boolean(table[name]) &&
      isUsed(info, info.fields.find((field) => field.name === name)!, table);
  return (only === undefined || only.includes(table['type'] as string)) &&
      (needed === undefined || has(needed)) && (without === undefined || !has(without));
}

function readStruct(view: DataView, at: number, info: TableInfo): unknown {
  const value = (field: FieldInfo): unknown =>
      readField(view, at === 0 ? 0 : at + field.at!, field);
  if (info.tuple) return info.fields.map(value);
  return Object.fromEntries(info.fields.map((field) => [field.name, value(field)]));
}

function readField(view: DataView, at: number, field: FieldInfo): unknown {
  const info = field.table === undefined ? undefined : tables[field.table]!;
  if (field.list) return readList(view, follow(view, at), field, info);
  if (field.type === 'string') {
    const text = follow(view, at);
    return text === 0 ? '' : decoder.decode(new Uint8Array(
        view.buffer, view.byteOffset + text + 4, view.getUint32(text, true)));
  }
  if (info !== undefined) {
    if (at === 0 && field.optional) return null;
    return info.struct !== undefined ? readStruct(view, at, info)
                                     : readTable(view, follow(view, at), info);
  }
  if (at === 0 && field.initial === null) return null;
  const number = at === 0 ? field.initial ?? 0 : readNumber(view, at, field.type);
  if (field.values !== undefined) return field.values[Number(number)];
  if (field.type === 'bool') return (number !== 0) !== (field.inverted === true);
  return field.type === 'ulong' && !field.number ? BigInt(number) : Number(number);
}

function readNumber(view: DataView, at: number, type: string): number | bigint {
  switch (type) {
    case 'bool':
    case 'ubyte': return view.getUint8(at);
    case 'short': return view.getInt16(at, true);
    case 'ushort': return view.getUint16(at, true);
    case 'uint': return view.getUint32(at, true);
    case 'float': return view.getFloat32(at, true);
    case 'double': return view.getFloat64(at, true);
    default: return view.getBigUint64(at, true);
  }
}

function readList(view: DataView, at: number, field: FieldInfo,
                  info: TableInfo | undefined): unknown {
  const length = at === 0 ? 0 : view.getUint32(at, true);
  if (info === undefined) {
    const type = arrays[field.type as keyof typeof arrays];
    const buffer = view.buffer as ArrayBuffer;
    const list = length === 0 ? new type(0) : new type(buffer, view.byteOffset + at + 4, length);
    return field.values === undefined ? list : Array.from(list, (value) => field.values![value]);
  }
  const size = info.struct?.[0] ?? 4;
  const list = Array.from({length}, (_, i) => info.struct !== undefined
      ? readStruct(view, at + 4 + size * i, info)
      : readTable(view, follow(view, at + 4 + size * i), info));
  return field.parameters ? parametersOf(list as never) : list;
}
