// Reads the part of the FlatBuffers language that protocol/schema uses, and writes down what a
// verifier must know of each table: generated/layout.ts. Whatever it does not know is an error.

const scalars = {
  bool: 1, byte: 1, ubyte: 1, short: 2, ushort: 2, int: 4, uint: 4, float: 4,
  long: 8, ulong: 8, double: 8,
};

/** @returns {{tables: Map<string, {name: string, type: string}[]>, structs, enums}} */
export function parseSchema(text) {
  const code = text.replace(/\/\/.*$/gm, '');
  const tables = new Map();
  const structs = new Map();
  const enums = new Map();
  const rest = code.replace(
      /\b(table|struct|enum)\s+(\w+)\s*(?::\s*(\w+)\s*)?\{([^}]*)\}/g,
      (_, what, name, base, body) => {
        if (what === 'enum') {
          if (scalars[base] === undefined) throw new Error(`enum ${name} has base ${base}`);
          enums.set(name, base);
          return '';
        }
        const fields = body.split(';').map((field) => field.trim()).filter(Boolean).map((field) => {
          const match = /^(\w+)\s*:\s*(\[\s*\w+\s*\]|\w+)\s*(=\s*[-\w.]+\s*)?$/.exec(field);
          if (!match) throw new Error(`${name}: "${field}" is not understood`);
          return {name: match[1], type: match[2].replace(/\s/g, '')};
        });
        (what === 'table' ? tables : structs).set(name, fields);
        return '';
      });
  const left = rest.replace(/\bnamespace\s+[\w.]+\s*;/, '').trim();
  if (left) throw new Error(`"${left.slice(0, 60)}" is not understood`);
  return {tables, structs, enums};
}

/** Size and alignment of what lies in a table or vector itself; undefined: an offset does. */
function inlineLayout(schema, type) {
  const scalar = scalars[type] ?? scalars[schema.enums.get(type)];
  if (scalar !== undefined) return {size: scalar, align: scalar};
  const fields = schema.structs.get(type);
  if (fields === undefined) return undefined;
  let size = 0;
  let align = 1;
  for (const field of fields) {
    const part = inlineLayout(schema, field.type);
    size = Math.ceil(size / part.align) * part.align + part.size;
    align = Math.max(align, part.align);
  }
  return {size: Math.ceil(size / align) * align, align};
}

/** What verify.ts reads: by table, by field: [kind, size or number of a table, alignment]. */
export function tableLayouts(schema) {
  const names = [...schema.tables.keys()];
  const tableNumber = (type, where) => {
    const number = names.indexOf(type);
    if (number < 0) throw new Error(`${where}: type ${type} is not known`);
    return number;
  };
  return names.map((name) => ({
    name,
    fields: schema.tables.get(name).map((field) => {
      const where = `${name}.${field.name}`;
      const vector = /^\[(\w+)\]$/.exec(field.type);
      const type = vector ? vector[1] : field.type;
      const inline = inlineLayout(schema, type);
      if (vector) {
        if (type === 'string') throw new Error(`${where}: lists of strings are not known`);
        return inline ? {name: field.name, layout: [2, inline.size, inline.align]}
                      : {name: field.name, layout: [4, tableNumber(type, where), 4]};
      }
      if (type === 'string') return {name: field.name, layout: [1, 1, 1]};
      return inline ? {name: field.name, layout: [0, inline.size, inline.align]}
                    : {name: field.name, layout: [3, tableNumber(type, where), 4]};
    }),
  }));
}

export function layoutModule(schema) {
  const layouts = tableLayouts(schema);
  const lines = layouts.map(({name, fields}) =>
      `  // ${name}\n  [${fields.map((field) => `[${field.layout.join(', ')}]`).join(', ')}],`);
  const numbers = layouts.map(({name}, number) => `  ${name}: ${number},`);
  return `// Written by scripts/generate.mjs from the schema; do not edit.

/** [kind, size or number of a table, alignment] of each field, in order. Kinds: 0 lies in the table,
 * 1 string, 2 vector of what lies in it, 3 table, 4 vector of tables. */
export type FieldLayout = readonly [kind: number, size: number, align: number];

export const tableNumbers = {
${numbers.join('\n')}
} as const;

export const tableLayouts: readonly (readonly FieldLayout[])[] = [
${lines.join('\n')}
];
`;
}
