import {maxDepth} from '../../generated/limits';
import {tables} from '../../generated/tables';

/**
 * Returns true if a FlatBuffers message can be read safely. All data reachable from the root must
 * be aligned and inside the payload. Strings must end with a zero byte. Nesting and the number of
 * tables are limited. The npm package `flatbuffers` has no such check.
 *
 * @param payload starts at a multiple of 8 within its frame
 * @param table number of the root's table in `tableNumbers`
 * @param maxTables limit of tables in the message
 */
export function verify(payload: DataView, table: number, maxTables: number): boolean {
  return new Verifier(payload, maxTables).root(table);
}

class Verifier {
  private readonly size: number;
  private tables = 0;

  constructor(private readonly view: DataView, private readonly maxTables: number) {
    this.size = view.byteLength;
  }

  root(table: number): boolean {
    const at = this.follow(0);
    return at > 0 && this.table(at, table, 1);
  }

  private inside(at: number, bytes: number, align: number): boolean {
    return at % align === 0 && at >= 0 && bytes <= this.size && at <= this.size - bytes;
  }

  /** Returns the target of the offset at `at`; 0 if it is invalid. */
  private follow(at: number): number {
    if (!this.inside(at, 4, 4)) return 0;
    const offset = this.view.getUint32(at, true);
    const target = at + offset;
    return offset > 0 && target < this.size ? target : 0;
  }

  /** Returns the number of entries of the vector at `at`; -1 if it is outside or misaligned. */
  private vector(at: number, size: number, align: number): number {
    if (!this.inside(at, 4, 4)) return -1;
    const count = this.view.getUint32(at, true);
    const bytes = count * size;  // The product is exact: count is below 2^32 and size is small.
    return this.inside(at + 4, bytes, 1) && (at + 4) % align === 0 ? count : -1;
  }

  private string(at: number): boolean {
    const length = this.vector(at, 1, 1);
    return length >= 0 && this.inside(at + 4 + length, 1, 1) &&
        this.view.getUint8(at + 4 + length) === 0;
  }

  private table(at: number, number: number, depth: number): boolean {
    if (depth > maxDepth || ++this.tables > this.maxTables) return false;
    if (!this.inside(at, 4, 4)) return false;
    const vtable = at - this.view.getInt32(at, true);
    if (!this.inside(vtable, 4, 2)) return false;
    const vtableBytes = this.view.getUint16(vtable, true);
    // The reader treats sizes and offsets as signed, so values above 0x7fff would be misread.
    if (vtableBytes < 4 || vtableBytes % 2 !== 0 || vtableBytes > 0x7fff ||
        !this.inside(vtable, vtableBytes, 2)) {
      return false;
    }
    const {fields} = tables[number]!;
    const known = Math.min(fields.length, (vtableBytes - 4) >> 1);
    for (let i = 0; i < known; ++i) {
      const offset = this.view.getUint16(vtable + 4 + 2 * i, true);
      if (offset === 0) continue;
      if (offset > 0x7fff || !this.field(at + offset, fields[i]!.layout, depth)) return false;
    }
    return true;
  }

  private field(at: number, [kind, size, align]: readonly [number, number, number],
                depth: number): boolean {
    if (kind === 0) return this.inside(at, size, align);
    const target = this.follow(at);
    if (target === 0) return false;
    switch (kind) {
      case 1: return this.string(target);
      case 2: return this.vector(target, size, align) >= 0;
      case 3: return this.table(target, size, depth + 1);
      default: {
        const count = this.vector(target, 4, 4);
        if (count < 0 || count > this.maxTables) return false;
        for (let i = 0; i < count; ++i) {
          const entry = this.follow(target + 4 + 4 * i);
          if (entry === 0 || !this.table(entry, size, depth + 1)) return false;
        }
        return true;
      }
    }
  }
}
