import type {ClientOptions} from './client_types';
import {native, webNames} from './native';

/** Options of the client that the session uses, with defaults filled in. */
export type SessionOptions = Required<Omit<ClientOptions, 'url' | 'webSocket' | 'now'>>;

/** Default value, least value and greatest value of each number, in the order in which the module
 * reads them. */
const numbers = {
  maxCommands: [4096, 1, 2 ** 20],
  poseHistory: [32, 4, 4096],
  maxPoseBytes: [256 * 2 ** 20, 0, 2 ** 40],
  recordingS: [20, 0, 3600],
  maxRecordingBytes: [192 * 2 ** 20, 0, 2 ** 40],
  connectTimeoutS: [5, 0.1, 600],
  pingIntervalS: [1, 0.05, 600],
  renderDelayS: [-1, -Infinity, 60],
  seed: [1, 0, 2 ** 32 - 1],
  maxRecordedEvents: [65_536, 1, 2 ** 24],
} as const;
const names = Object.keys(numbers) as (keyof typeof numbers)[];

export const defaultOptions: SessionOptions = {
  clientName: 'stridewire-web',
  authToken: '',
  respawn: false,
  libraryCache: null,
  ...Object.fromEntries(names.map((name) => [name, numbers[name][0]])) as
      {[name in keyof typeof numbers]: number},
};

/**
 * Creates a client in the WebAssembly module and returns its address.
 * @throws RangeError a number among the options is out of range
 * @throws TypeError a text among the options is invalid
 */
export function createClient(options: SessionOptions): number {
  for (const name of names) {
    const [, least, most] = numbers[name];
    const value = options[name];
    if (typeof value !== 'number' || !(value >= least && value <= most)) {
      throw new RangeError(`${name}: expected a number from ${least} to ${most}, got ${value}`);
    }
  }
  const encoder = new TextEncoder();
  const [name, token] = (['clientName', 'authToken'] as const).map((option) => {
    if (typeof options[option] !== 'string' || /\p{Surrogate}/u.test(options[option])) {
      throw new TypeError(`${option}: expected a string without lone surrogates`);
    }
    return encoder.encode(options[option]);
  }) as [Uint8Array, Uint8Array];
  const values = Float64Array.of(...names.map((each) => options[each]), Number(options.respawn),
                                 Number(options.libraryCache !== null));
  native().setInput(new Uint8Array(values.buffer), name, token);
  const client = native().call.create(name.length, token.length);
  if (client === 0) throw new TypeError(webNames(native().text));
  return client;
}
