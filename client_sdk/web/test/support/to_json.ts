import type {Message} from '../../generated/messages';
import {jsonFields, type JsonField} from '../../generated/json';
import {tableNumbers, tables, type FieldInfo} from '../../generated/tables';
import {decodePoses} from '../../src/testing';
import {parameterList} from '../../src/wire/parameters';
import {isUsed} from '../../src/wire/read';
import {vectorInfo} from './vectors';

type Fields = {readonly [name: string]: unknown};

/** Converts a message to the JSON of protocol/vectors, which uses the names of the schema. */
export function toJson(m: Message, frame: ArrayBuffer): Fields {
  const json = convertTable(tableNumbers[m.type], m as never);
  if (m.type !== 'PoseBatch') return json;
  const {rootsM, rotations} = decodePoses(frame, vectorInfo());
  const {avatars: _, flags: _flags, ...fields} = json;
  return {
    ...fields,
    poses: Array.from(m.avatars, (avatar, i) => ({
      avatar, flags: m.flags[i], root_position_m: [...rootsM.subarray(3 * i, 3 * i + 3)],
      rotations: Array.from({length: m.jointCount}, (_joint, j) => {
        const at = 4 * (i * m.jointCount + j);
        return [...rotations.subarray(at, at + 4)];
      }),
    })),
  };
}

function convertTable(table: number, value: Fields): Fields {
  const info = tables[table]!;
  const json: {[name: string]: unknown} = {};
  info.fields.forEach((field, i) => {
    if (field.deprecated || !isUsed(info, field, value)) return;
    const rules = jsonFields[table]![i]!;
    const member = convert(field, value[field.name], rules);
    const decides = rules.omit ? value[rules.omit] : member;
    if (rules.group) json[rules.group] = [...(json[rules.group] ?? []) as unknown[], member];
    else if (rules.omit === undefined || !isEmpty(decides)) json[rules.name] = member;
  });
  return json;
}

function isEmpty(value: unknown): boolean {
  return !value || (Array.isArray(value) && value.length === 0);
}

function convert(field: FieldInfo, value: unknown, rules: JsonField): unknown {
  if (rules.bytes) return Buffer.from(value as Uint8Array).toString('hex');
  if (field.parameters) return parameterList(value as never);
  if (value === null) return null;
  return field.list ? Array.from(value as never, (entry) => convertEntry(field, entry, rules))
                    : convertEntry(field, value, rules);
}

function convertEntry(field: FieldInfo, value: unknown, rules: JsonField): unknown {
  const info = field.table === undefined ? undefined : tables[field.table]!;
  if (info?.alone) return value;
  if (info?.tuple) {
    const numbers = [...value as number[]];
    return rules.array ? numbers
        : Object.fromEntries(info.fields.map(({name}, i) => [name, numbers[i]]));
  }
  if (info !== undefined) return convertTable(field.table!, value as Fields);
  if (field.values !== undefined) return field.values.indexOf(value as string);
  if (field.inverted) return !value;
  return field.type === 'ulong' ? String(value) : value;
}
