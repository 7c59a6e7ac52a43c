import {Client} from '../../src/client';
import type {ClientOptions, WebSocketLike} from '../../src/client_types';
import {createCrowdPose} from '../../src/pose_buffers';
import type {CrowdPose} from '../../src/types';

/** Result of `replayMovements`. */
export interface Replay {
  ticks: number;
  poses: number;
  /** Server times of ticks whose poses differ from those of the C++ client. */
  differences: number[];
}

/** A WebSocket whose frames come from a file. */
class FileSocket implements WebSocketLike {
  static last: FileSocket;
  binaryType = '';
  readyState = 1;
  bufferedAmount = 0;
  onopen: ((event: unknown) => void) | null = null;
  onmessage: ((event: {data: ArrayBuffer}) => void) | null = null;
  onclose: ((event: unknown) => void) | null = null;
  onerror: ((event: unknown) => void) | null = null;
  constructor() {
    FileSocket.last = this;
  }
  send(): void {}
  close(): void {}
}

function hashOf(crowd: CrowdPose): number {
  let hash = 2166136261;
  const add = (words: ArrayLike<number>): void => {
    for (let i = 0; i < words.length; ++i) hash = Math.imul(hash ^ words[i]!, 16777619);
  };
  const bits = (numbers: Float32Array, count: number): Uint32Array =>
      new Uint32Array(numbers.buffer, numbers.byteOffset, count);
  add(crowd.avatars.subarray(0, crowd.count));
  add(crowd.flags.subarray(0, crowd.count));
  add(bits(crowd.rootsM, 3 * crowd.count));
  add(bits(crowd.rotations, 4 * crowd.jointCount * crowd.count));
  return (hash >>> 0) || 1;
}

/** Passes the frames in a file of movement_stream.cpp to a client in movement mode, and compares
 * the poses of each tick. Runs in Node.js, in browsers and in workers. */
export async function replayMovements(
    file: ArrayBuffer, options: Partial<ClientOptions> = {}): Promise<Replay> {
  let nowMs = 0;
  const client = new Client({
    url: 'ws://file/', webSocket: FileSocket, libraryCache: null, now: () => nowMs, seed: 1,
    recordingS: 0, ...options
  });
  const world = client.joinWorld('plaza', 'observer');
  const observed = world.observe({mode: 'movement'});
  client.connect();
  while (client.state !== 'connecting') {
    nowMs += 10;
    await new Promise((resolve) => setTimeout(resolve, 1));
  }
  const socket = FileSocket.last;
  socket.onopen!({});
  const result: Replay = {ticks: 0, poses: 0, differences: []};
  const crowd = createCrowdPose();
  const view = new DataView(file);
  for (let at = 0; at < file.byteLength;) {
    const bytes = view.getUint32(at, true);
    const hash = view.getUint32(at + 4, true);
    const timeS = view.getFloat64(at + 8, true);
    socket.onmessage!({data: file.slice(at + 16, at + 16 + bytes)});
    at += 16 + bytes;
    if (hash === 0) continue;
    ++result.ticks;
    result.poses += world.sampleAll(timeS, crowd);
    if (hashOf(crowd) !== hash) result.differences.push(timeS);
  }
  const reply = await observed.reply;
  if (!reply.ok || client.lastError !== '') throw new Error(reply.text || client.lastError);
  client.close();
  return result;
}
