import {Client} from '../../src/client';
import type {ClientOptions} from '../../src/client_types';
import {createPose} from '../../src/pose_buffers';
import type {World} from '../../src/types';

/** No step moves an avatar faster than this, in m/s. */
const maxSpeedMS = 3;

/** What RestartProbe has counted. */
export interface RestartReport {
  requests: number;
  /** Requests with a reply. */
  answered: number;
  /** Requests whose reply was `session_lost`. */
  lost: number;
  /** Accepted requests whose step has ended. */
  ended: number;
  /** Replies other than `ok` and `session_lost`, and requests with several replies, starts or ends.
   */
  errors: string[];
  lostSessions: number;
  reconnects: number;
  samples: number;
  /** Changes of the segment of sampled poses. */
  segments: number;
  /** Largest distance between successive samples of a segment, minus the distance that
   * `maxSpeedMS` allows. */
  largestM: number;
}

/**
 * A client that lets an avatar walk while a test restarts the server, and counts what happens to
 * its requests. Runs in Node.js and in browsers.
 */
export class RestartProbe {
  private readonly replies = new Map<bigint, string>();
  private readonly starts = new Map<bigint, number>();
  private readonly ends = new Map<bigint, number>();
  private nextId = 1n;
  private lostSessions = 0;
  private readonly errors: string[] = [];
  private samples = 0;
  private segments = 0;
  private largestM = 0;
  private readonly sampler: ReturnType<typeof setInterval>;

  private constructor(readonly client: Client, private readonly world: World) {
    client.on('sessionLost', () => void ++this.lostSessions);
    world.on('event', (event) => {
      if (!('requestId' in event) || event.requestId === 0n) return;
      if (event.type === 'started') this.count('starts', event.requestId);
      if (event.type === 'finished') this.count('ends', event.requestId);
    });
    const pose = createPose();
    let last: {timeS: number, segment: number, rootM: number[]} | null = null;
    this.sampler = setInterval(() => {
      const timeS = client.renderTimeS();
      if (timeS === null || world.sample(1, timeS, pose) === 'missing') return;
      const rootM = [...pose.rootM];
      ++this.samples;
      if (last !== null && last.segment !== pose.segment) ++this.segments;
      if (last !== null && last.segment === pose.segment) {
        const movedM = Math.hypot(...rootM.map((value, i) => value - last!.rootM[i]!));
        this.largestM =
            Math.max(this.largestM, movedM - maxSpeedMS * Math.abs(timeS - last.timeS));
      }
      last = {timeS, segment: pose.segment, rootM};
    }, 5);
  }

  static async start(options: ClientOptions): Promise<RestartProbe> {
    const client = new Client({seed: 1, respawn: true, recordingS: 2, ...options});
    client.connect();
    const world = client.joinWorld('plaza');
    const probe = new RestartProbe(client, world);
    const spawned = await world.spawn([{avatar: 1, positionM: [0, 0, 0], headingRad: 0}]);
    const observed = await world.observe({mode: 'full'}).reply;
    if (!spawned.ok || !observed.ok) throw new Error(spawned.text || observed.text);
    return probe;
  }

  /** Requests a step. */
  request(): void {
    const requestId = this.nextId++;
    void this.world.request([{avatar: 1, requestId, type: 'step', lengthM: 0.5}]).then((reply) => {
      const {status} = reply;
      if (this.replies.has(requestId)) this.errors.push(`request ${requestId} has two replies`);
      if (status !== 'ok' && status !== 'session_lost') this.errors.push(`${requestId}: ${status}`);
      this.replies.set(requestId, status);
    });
  }

  get report(): RestartReport {
    const statuses = [...this.replies.values()];
    return {
      requests: Number(this.nextId) - 1, answered: statuses.length,
      lost: statuses.filter((status) => status === 'session_lost').length,
      ended: this.ends.size, errors: this.errors, lostSessions: this.lostSessions,
      reconnects: this.client.statistics.reconnects, samples: this.samples,
      segments: this.segments, largestM: this.largestM,
    };
  }

  close(): void {
    clearInterval(this.sampler);
    this.client.close();
  }

  private count(what: 'starts' | 'ends', id: bigint): void {
    const times = (this[what].get(id) ?? 0) + 1;
    this[what].set(id, times);
    if (times > 1) this.errors.push(`request ${id} has ${times} ${what}`);
  }
}
