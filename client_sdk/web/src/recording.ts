import {createKeys, copyPose, interpolate} from './interpolate';
import {flagsOf, lastingFlags} from './pose_flags';
import {reserve} from './room';
import {streamOf} from './stream_of';
import {PoseFlag, type CrowdPose, type Recording, type WorldEvent} from './types';
import type {BatchMode, PoseBatch} from './wire/messages';
import {PoseReader} from './wire/pose_codec';

/** After its last batch a shard's avatars are shown for this long. */
const keepS = 2;
/** Decoded moments kept for a shard: what playing forwards or backwards needs. */
const cachedMoments = 8;
const eventBytes = 400;

/** What arrived of one shard for one tick, as it came. */
interface Moment {
  readonly tick: number;
  readonly timeS: number;
  readonly mode: BatchMode;
  readonly jointCount: number;
  /** Of another one than the moment before: does not continue it. */
  readonly epoch: number;
  readonly parts: PoseBatch[];
  bytes: number;
}

interface Decoded {
  moment: Moment | null;
  used: number;
  count: number;
  avatars: Uint32Array;
  flags: Uint8Array;
  roots: Float32Array;
  rotations: Float32Array;
  /** Place of an avatar. */
  readonly places: Map<number, number>;
}

/** What one shard has to say about a time. */
interface Around {
  readonly at: Decoded;
  readonly exact: boolean;
  readonly atEnd: Decoded | null;
  readonly atBefore: Decoded | null;
  readonly atBeyond: Decoded | null;
}

interface Stream {
  /** Oldest first, from `first` on: the array is cut when half of it is old. */
  moments: Moment[];
  first: number;
  readonly decoded: Decoded[];
}

/** The last seconds of a world, as received. Nothing is decoded before it is asked for. */
export class WorldRecording implements Recording {
  private readonly streams = new Map<number, Stream>();
  private eventList: WorldEvent[] = [];
  private firstEvent = 0;
  private poseBytes = 0;
  private newestS = NaN;
  private uses = 0;
  private readonly keys = createKeys();
  /** Place in the crowd that sampleAll fills, by avatar. */
  private readonly placed = new Map<number, number>();
  private readonly around: Around[] = [];

  constructor(private readonly lengthS: number, private readonly maxBytes: number,
              private readonly maxEvents: number,
              private readonly wants: (avatar: number) => boolean) {}

  get firstTimeS(): number {
    let firstS = Infinity;
    for (const {moments, first} of this.streams.values()) {
      const moment = moments[first];
      if (moment !== undefined && moment.timeS < firstS) firstS = moment.timeS;
    }
    return firstS === Infinity ? NaN : firstS;
  }

  get lastTimeS(): number {
    return this.newestS;
  }

  get bytes(): number {
    return this.poseBytes + (this.eventList.length - this.firstEvent) * eventBytes;
  }

  clear(): void {
    this.streams.clear();
    this.eventList = [];
    this.firstEvent = 0;
    this.poseBytes = 0;
    this.newestS = NaN;
  }

  /** A batch whose poses are known to be good. Of a tick that comes twice, in two modes, the first
   * is kept; those of a region are of different avatars, and all are kept. */
  addBatch(batch: PoseBatch, epoch: number): void {
    if (this.lengthS <= 0 || this.maxBytes <= 0) return;
    const key = batch.partial ? -1 - streamOf(batch) : batch.shard;
    let stream = this.streams.get(key);
    if (stream === undefined) {
      stream = {moments: [], first: 0, decoded: []};
      this.streams.set(key, stream);
    }
    const bytes = batch.poses.buffer.byteLength;
    const last = stream.moments[stream.moments.length - 1];
    if (last !== undefined && last.tick === batch.tick) {
      if (last.mode !== batch.mode || last.parts.some((part) => part.part === batch.part)) return;
      last.parts.push(batch);
      last.bytes += bytes;
      for (const decoded of stream.decoded) {
        if (decoded.moment === last) decoded.moment = null;
      }
    } else if (last === undefined ||
               (last.tick < batch.tick && last.timeS < batch.serverTimeS)) {
      stream.moments.push({
        tick: batch.tick,
        timeS: batch.serverTimeS,
        mode: batch.mode,
        jointCount: batch.jointCount,
        epoch,
        parts: [batch],
        bytes,
      });
    } else {
      return;
    }
    this.poseBytes += bytes;
    this.newestS = Number.isNaN(this.newestS) ? batch.serverTimeS
                                              : Math.max(this.newestS, batch.serverTimeS);
    this.dropOld();
  }

  addEvent(event: WorldEvent): void {
    if (this.lengthS <= 0) return;
    this.eventList.push(event);
    while (this.eventList.length - this.firstEvent > this.maxEvents ||
           this.eventList[this.firstEvent]!.timeS < event.timeS - this.lengthS) {
      ++this.firstEvent;
    }
    if (2 * this.firstEvent > this.eventList.length) {
      this.eventList = this.eventList.slice(this.firstEvent);
      this.firstEvent = 0;
    }
  }

  events(fromS: number, toS: number): WorldEvent[] {
    const found: WorldEvent[] = [];
    for (let i = this.firstEvent; i < this.eventList.length; ++i) {
      const event = this.eventList[i]!;
      if (event.timeS >= fromS && event.timeS <= toS) found.push(event);
    }
    return found;
  }

  sampleAll(timeS: number, out: CrowdPose): number {
    this.placed.clear();
    out.count = 0;
    this.around.length = 0;
    for (const stream of this.streams.values()) this.collect(stream, timeS, out);
    // In growing order of number, as World.sampleAll has them.
    if (out.count > 1) out.avatars.subarray(0, out.count).sort();
    for (let i = 0; i < out.count; ++i) this.placed.set(out.avatars[i]!, i);
    // Who crossed a ring of a region is in the moments of two details: the later one holds.
    this.around.sort((a, b) => a.at.moment!.tick - b.at.moment!.tick);
    for (const around of this.around) this.fill(around, timeS, out);
    return out.count;
  }

  /** Finds the moments around a time, and who is there. */
  private collect(stream: Stream, timeS: number, out: CrowdPose): void {
    const {moments, first} = stream;
    let low = first;
    let high = moments.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (moments[middle]!.timeS > timeS) {
        high = middle;
      } else {
        low = middle + 1;
      }
    }
    if (low === first) return;
    const start = moments[low - 1]!;
    const end = moments[low];
    if (end === undefined && timeS - start.timeS > keepS) return;
    const at = this.decode(stream, start);
    const continues = (from: Moment | undefined, to: Moment | undefined): to is Moment =>
        from !== undefined && to !== undefined && from.epoch === to.epoch &&
        from.jointCount === to.jointCount;
    const exact = start.timeS === timeS;
    const atEnd = !exact && continues(start, end) ? this.decode(stream, end) : null;
    const before = low - 2 >= first ? moments[low - 2] : undefined;
    const atBefore =
        atEnd !== null && continues(before, start) ? this.decode(stream, before!) : null;
    const beyond = moments[low + 1];
    const atBeyond = atEnd !== null && continues(end, beyond) ? this.decode(stream, beyond) : null;
    this.around.push({at, exact, atEnd, atBefore, atBeyond});

    out.jointCount = start.jointCount;
    reserve(out, out.count + at.count, start.jointCount);
    for (let i = 0; i < at.count; ++i) {
      const avatar = at.avatars[i]!;
      if (!this.wants(avatar) || this.placed.has(avatar)) continue;
      this.placed.set(avatar, 0);
      out.avatars[out.count++] = avatar;
    }
  }

  private fill({at, exact, atEnd, atBefore, atBeyond}: Around, timeS: number,
               out: CrowdPose): void {
    const jointCount = at.moment!.jointCount;
    if (jointCount !== out.jointCount) return;
    for (let i = 0; i < at.count; ++i) {
      const avatar = at.avatars[i]!;
      const place = this.placed.get(avatar);
      if (place === undefined) continue;
      const lasting = at.flags[i]! & lastingFlags;
      const j = atEnd?.places.get(avatar);
      if (j === undefined || (atEnd!.flags[j]! & PoseFlag.discontinuity) !== 0) {
        copyPose(at.roots, at.rotations, i, jointCount, out.rootsM, 3 * place, out.rotations,
                 4 * jointCount * place);
        out.flags[place] = exact ? at.flags[i]! : lasting | PoseFlag.held;
        continue;
      }
      const b = (at.flags[i]! & PoseFlag.discontinuity) === 0 ? atBefore?.places.get(avatar)
                                                              : undefined;
      let n = atBeyond?.places.get(avatar);
      if (n !== undefined && (atBeyond!.flags[n]! & PoseFlag.discontinuity) !== 0) n = undefined;
      this.setKey(0, b === undefined ? at : atBefore!, b ?? i);
      this.setKey(1, at, i);
      this.setKey(2, atEnd!, j);
      this.setKey(3, n === undefined ? atEnd! : atBeyond!, n ?? j);
      interpolate(this.keys, timeS, jointCount, out.rootsM, 3 * place, out.rotations,
                  4 * jointCount * place);
      out.flags[place] = lasting;
    }
  }

  private setKey(key: number, decoded: Decoded, place: number): void {
    this.keys.roots[key] = decoded.roots;
    this.keys.rotations[key] = decoded.rotations;
    this.keys.places[key] = place;
    this.keys.timesS[key] = decoded.moment!.timeS;
  }

  private decode(stream: Stream, moment: Moment): Decoded {
    let oldest: Decoded | null = null;
    for (const decoded of stream.decoded) {
      if (decoded.moment === moment) {
        decoded.used = ++this.uses;
        return decoded;
      }
      if (oldest === null || decoded.used < oldest.used) oldest = decoded;
    }
    if (oldest === null || stream.decoded.length < cachedMoments) {
      oldest = {
        moment: null,
        used: 0,
        count: 0,
        avatars: new Uint32Array(0),
        flags: new Uint8Array(0),
        roots: new Float32Array(0),
        rotations: new Float32Array(0),
        places: new Map(),
      };
      stream.decoded.push(oldest);
    }
    const into = oldest;
    const jointCount = moment.jointCount;
    let count = 0;
    for (const part of moment.parts) count += part.avatars.length;
    if (into.avatars.length < count || into.rotations.length < 4 * count * jointCount) {
      into.avatars = new Uint32Array(count);
      into.flags = new Uint8Array(count);
      into.roots = new Float32Array(3 * count);
      into.rotations = new Float32Array(4 * count * jointCount);
    }
    into.moment = null;
    into.places.clear();
    let place = 0;
    for (const part of moment.parts) {
      const reader = new PoseReader(part);
      for (let i = 0; i < part.avatars.length; ++i) {
        // Those that nobody wanted were not looked at when they came, and may be none.
        if (!reader.read(i, into.roots, 3 * place, into.rotations, 4 * jointCount * place)) {
          continue;
        }
        into.avatars[place] = part.avatars[i]!;
        into.flags[place] = flagsOf(part.flags[i]!, part.mode);
        into.places.set(part.avatars[i]!, place++);
      }
    }
    into.count = place;
    into.moment = moment;
    into.used = ++this.uses;
    return into;
  }

  private dropOld(): void {
    for (;;) {
      let oldest: Stream | null = null;
      for (const stream of this.streams.values()) {
        const moment = stream.moments[stream.first];
        if (moment !== undefined &&
            (oldest === null || moment.timeS < oldest.moments[oldest.first]!.timeS)) {
          oldest = stream;
        }
      }
      if (oldest === null) return;
      const moment = oldest.moments[oldest.first]!;
      if (moment.timeS >= this.newestS - this.lengthS && this.poseBytes <= this.maxBytes) return;
      this.poseBytes -= moment.bytes;
      oldest.moments[oldest.first++] = undefined as never;  // Its memory goes now.
      if (2 * oldest.first > oldest.moments.length) {
        oldest.moments = oldest.moments.slice(oldest.first);
        oldest.first = 0;
      }
    }
  }
}
