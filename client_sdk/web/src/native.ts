import moduleBytes from '../build/client.wasm';
import type {Exports} from '../generated/native';

const textAt = 14;
const textBytes = 15;
const decoder = new TextDecoder();
const encoder = new TextEncoder();

/** A module with a SIMD instruction. It is invalid if the browser does not support SIMD. */
const simdModule = Uint8Array.of(
    0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253,
    15, 253, 98, 11);

/** The client's session and codecs, compiled to WebAssembly. All clients share one instance. */
class Native {
  readonly call: Exports;
  /** Text that the module has written to stderr. */
  private log = '';
  private readonly resultsAt: number;
  private buffer = new ArrayBuffer(0);
  private resultList = new Float64Array(0);
  private memory = new Uint8Array(0);

  constructor(module: WebAssembly.Module) {
    // The module writes text only before it stops, to explain which invariant is broken.
    const instance = new WebAssembly.Instance(module, {wasi_snapshot_preview1: {
      fd_write: (_fd: number, list: number, count: number, writtenAt: number): number => {
        const view = new DataView(this.call.memory.buffer);
        let written = 0;
        for (let i = 0; i < count; ++i) {
          const at = view.getUint32(list + 8 * i, true);
          const bytes = view.getUint32(list + 8 * i + 4, true);
          this.log += decoder.decode(new Uint8Array(view.buffer, at, bytes).slice());
          written += bytes;
        }
        view.setUint32(writtenAt, written, true);
        return 0;
      },
      fd_close: () => 0,
      fd_seek: () => 70,  // Not seekable.
    }});
    this.call = instance.exports as unknown as Exports;
    this.call._initialize();
    this.resultsAt = this.call.results();
  }

  /** The numbers in `results` that the last call has set. */
  get results(): Float64Array {
    this.refresh();
    return this.resultList;
  }

  /** The text that the last call has set. */
  get text(): string {
    const {results} = this;
    // The text is copied first, because browsers cannot decode text in memory that can grow.
    const at = results[textAt]!;
    return decoder.decode(this.memory.slice(at, at + results[textBytes]!));
  }

  /** Copies bytes of the module. */
  bytes(at: number, count: number): Uint8Array<ArrayBuffer> {
    this.refresh();
    return this.memory.slice(at, at + count);
  }

  /** Memory of the module. It becomes invalid when the module allocates memory. */
  get memoryBuffer(): ArrayBuffer {
    return this.call.memory.buffer;
  }

  /** Copies lists of bytes to the memory for arguments, one after the other. Returns the total
   * number of bytes. */
  setInput(...lists: Uint8Array[]): number {
    const count = lists.reduce((sum, {length}) => sum + length, 0);
    let at = this.call.input(count);
    this.refresh();
    for (const bytes of lists) {
      this.memory.set(bytes, at);
      at += bytes.length;
    }
    return count;
  }

  setInputText(text: string): number {
    return this.setInput(encoder.encode(text));
  }

  /** If the module has stopped, returns an error that contains the text that the module printed. */
  explain(error: unknown): unknown {
    if (!(error instanceof WebAssembly.RuntimeError)) return error;
    const explained = new Error(`Stridewire's WebAssembly module has stopped: ${
        this.log.trim() || error.message}`, {cause: error});
    return explained;
  }

  private refresh(): void {
    const {buffer} = this.call.memory;
    if (buffer === this.buffer) return;
    this.buffer = buffer;
    this.memory = new Uint8Array(buffer);
    this.resultList = new Float64Array(buffer, this.resultsAt, 32);
  }
}

let loaded: Native | null = null;
let failure = '';
if (typeof WebAssembly === 'undefined') {
  failure = 'this environment has no WebAssembly, which @stridewire/client needs';
} else if (!WebAssembly.validate(simdModule)) {
  failure = 'this environment has no WebAssembly SIMD, which @stridewire/client needs: use ' +
      'Chrome 91, Firefox 89, Safari 16.4, Node.js 18 or newer';
} else {
  try {
    // On their main thread, browsers compile large modules only asynchronously.
    loaded = new Native(await WebAssembly.compile(moduleBytes));
  } catch (error) {
    failure = `@stridewire/client cannot compile its WebAssembly module: ${String(error)}`;
  }
}

/**
 * Returns the module.
 * @throws Error WebAssembly or its SIMD instructions are missing, or the module cannot be compiled
 */
export function native(): Native {
  if (loaded === null) throw new Error(failure);
  return loaded;
}

/** Converts the snake_case names of fields in an error text of the module to camelCase. */
export function webNames(text: string): string {
  return text.replace(/_([a-z])/g, (_, letter: string) => letter.toUpperCase());
}

/**
 * A view of the module's memory. It is created again only if the memory, the address or the length
 * has changed.
 */
export class MemoryView<T extends Float32Array | Uint32Array | Uint8Array> {
  private view: T;

  constructor(private readonly type: new (buffer: ArrayBuffer, at: number, length: number) => T) {
    this.view = new type(new ArrayBuffer(0), 0, 0);
  }

  get(at: number, length: number): T {
    const buffer = native().memoryBuffer;
    if (this.view.buffer !== buffer || this.view.byteOffset !== at || this.view.length !== length) {
      this.view = new this.type(buffer, at, length);
    }
    return this.view;
  }
}
