import type {ClientOptions} from './client_types';
import {native, webNames} from './native';

/** Options of the client that the session uses, with defaults filled in. */
export type SessionOptions = Required<Omit<ClientOptions, 'url' | 'webSocket' | 'now'>>;

export const defaultOptions: Omit<SessionOptions, 'seed'> = {
  clientName: 'stridewire-web',
  authToken: '',
  renderDelayS: -1,
  respawn: false,
  maxCommands: 4096,
  poseHistory: 32,
  maxPoseBytes: 256 * 2 ** 20,
  recordingS: 20,
  maxRecordingBytes: 192 * 2 ** 20,
  maxRecordedEvents: 65_536,
  libraryCache: null,
  connectTimeoutS: 5,
  pingIntervalS: 1,
};

/**
 * Creates a client in the WebAssembly module and returns its address.
 * @throws RangeError a number among the options is out of range
 * @throws TypeError a text among the options is invalid
 */
export function createClient(options: SessionOptions): number {
  checkNumbers(options);
  const encoder = new TextEncoder();
  for (const name of ['clientName', 'authToken'] as const) {
    if (typeof options[name] !== 'string' || /\p{Surrogate}/u.test(options[name])) {
      throw new TypeError(`${name}: expected a string without lone surrogates`);
    }
  }
  const name = encoder.encode(options.clientName);
  const token = encoder.encode(options.authToken);
  const numbers = Float64Array.of(
      options.maxCommands, options.poseHistory, options.maxPoseBytes, options.recordingS,
      options.maxRecordingBytes, options.connectTimeoutS, options.pingIntervalS,
      Number(options.respawn), options.seed, options.renderDelayS,
      Number(options.libraryCache !== null));
  native().setInput(new Uint8Array(numbers.buffer), name, token);
  const client = native().call.create(name.length, token.length);
  if (client === 0) throw new TypeError(webNames(native().text));
  return client;
}

function checkNumbers(options: SessionOptions): void {
  const range = (name: keyof SessionOptions, least: number, most: number): void => {
    const value = options[name];
    if (typeof value !== 'number' || !(value >= least && value <= most)) {
      throw new RangeError(`${name}: expected a number from ${least} to ${most}, got ${value}`);
    }
  };
  range('renderDelayS', -Infinity, 60);
  range('maxCommands', 1, 1 << 20);
  range('poseHistory', 4, 4096);
  range('maxPoseBytes', 0, 2 ** 40);
  range('recordingS', 0, 3600);
  range('maxRecordingBytes', 0, 2 ** 40);
  range('maxRecordedEvents', 1, 2 ** 24);
  range('connectTimeoutS', 0.1, 600);
  range('pingIntervalS', 0.05, 600);
  range('seed', 0, 2 ** 32 - 1);
}
