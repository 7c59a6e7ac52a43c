import {streamOf} from './batch_stream';
import {createKeys, copyPose, interpolate} from './interpolate';
import {reserve} from './pose_buffers';
import {flagsOf, lastingFlags} from './pose_flags';
import {PoseFlag, type CrowdPose, type Recording, type WorldEvent} from './types';
import type {BatchMode, DecodableBatch as PoseBatch} from './wire/messages';
import {PoseReader} from './wire/pose_codec';

/** Time after the last batch of its stream for which an avatar can be sampled. */
const keepS = 2;
/** Number of decoded ticks to cache per stream. Playback in either direction needs four of them. */
const maxDecodedTicks = 8;
/** Estimated memory of an event. */
const eventBytes = 400;

/** The encoded poses that a stream received for one tick. */
interface RecordedTick {
  readonly tick: number;
  readonly timeS: number;
  readonly mode: BatchMode;
  readonly jointCount: number;
  /** Poses of different epochs are not interpolated, see `WorldView.startNewEpoch`. */
  readonly epoch: number;
  readonly parts: PoseBatch[];
  bytes: number;
}

/** The decoded poses of a recorded tick. The buffers are reused for other ticks. */
interface DecodedTick {
  /** The recorded tick that the buffers contain; null if they are free or outdated. */
  source: RecordedTick | null;
  /** Increases with each use, to find the least recently used buffers. */
  lastUse: number;
  count: number;
  avatars: Uint32Array;
  flags: Uint8Array;
  roots: Float32Array;
  rotations: Float32Array;
  /** Index into the arrays by avatar id. */
  readonly indices: Map<number, number>;
}

/** The ticks of a stream around a sampled time, as cubic interpolation needs them. */
interface Neighbours {
  /** The last tick at or before the time. */
  readonly start: DecodedTick;
  /** True if `start` is exactly at the time; the others are then null. */
  readonly exact: boolean;
  /** The tick after `start`; null if there is none or it is not continuous. */
  readonly end: DecodedTick | null;
  /** The tick before `start`; null for the same reasons. */
  readonly before: DecodedTick | null;
  /** The tick after `end`; null for the same reasons. */
  readonly beyond: DecodedTick | null;
}

interface Stream {
  /** Oldest first. Entries before `first` are dropped; they are cut off once they are the
   * majority. */
  ticks: RecordedTick[];
  first: number;
  readonly decoded: DecodedTick[];
}

/** The last seconds of a world as received. Batches are decoded only when they are sampled. */
export class WorldRecording implements Recording {
  private readonly streams = new Map<number, Stream>();
  private eventList: WorldEvent[] = [];
  private firstEvent = 0;
  private poseBytes = 0;
  private newestS = NaN;
  private useCount = 0;
  private readonly keys = createKeys();
  /** Index into the output of `sampleAll`, by avatar id. */
  private readonly outIndices = new Map<number, number>();
  private readonly neighbours: Neighbours[] = [];

  /** `wants` returns whether an avatar is to be included in samples. */
  constructor(private readonly lengthS: number, private readonly maxBytes: number,
              private readonly maxEvents: number,
              private readonly wants: (avatar: number) => boolean) {}

  get firstTimeS(): number {
    let firstS = Infinity;
    for (const {ticks, first} of this.streams.values()) {
      const oldest = ticks[first];
      if (oldest !== undefined && oldest.timeS < firstS) firstS = oldest.timeS;
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

  /**
   * Adds a batch of valid poses. If a tick of a shard arrives in two modes, only the first is kept.
   * Batches of a region are an exception: those of different modes contain different avatars.
   */
  addBatch(batch: PoseBatch, epoch: number): void {
    if (this.lengthS <= 0 || this.maxBytes <= 0) return;
    const key = batch.partial ? -1 - streamOf(batch) : batch.shard;
    let stream = this.streams.get(key);
    if (stream === undefined) {
      stream = {ticks: [], first: 0, decoded: []};
      this.streams.set(key, stream);
    }
    const bytes = batch.poses.buffer.byteLength;
    const last = stream.ticks[stream.ticks.length - 1];
    if (last !== undefined && last.tick === batch.tick) {
      if (last.mode !== batch.mode || last.parts.some((part) => part.part === batch.part)) return;
      last.parts.push(batch);
      last.bytes += bytes;
      for (const decoded of stream.decoded) {
        if (decoded.source === last) decoded.source = null;
      }
    } else if (last === undefined ||
               (last.tick < batch.tick && last.timeS < batch.serverTimeS)) {
      stream.ticks.push({
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

  /** Adds an event and drops those that are too old or too many. */
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
    this.outIndices.clear();
    out.count = 0;
    this.neighbours.length = 0;
    for (const stream of this.streams.values()) this.addNeighbours(stream, timeS, out);
    if (out.count > 1) out.avatars.subarray(0, out.count).sort();
    for (let i = 0; i < out.count; ++i) this.outIndices.set(out.avatars[i]!, i);
    // An avatar that crossed a ring of a region is in the ticks of two details. The later one wins,
    // because it is written last.
    this.neighbours.sort((a, b) => a.start.source!.tick - b.start.source!.tick);
    for (const neighbours of this.neighbours) this.interpolateStream(neighbours, timeS, out);
    return out.count;
  }

  /** Finds the ticks of a stream around a time, and adds their avatars to `out.avatars`. */
  private addNeighbours(stream: Stream, timeS: number, out: CrowdPose): void {
    const {ticks, first} = stream;
    let low = first;
    let high = ticks.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (ticks[middle]!.timeS > timeS) {
        high = middle;
      } else {
        low = middle + 1;
      }
    }
    if (low === first) return;
    const startTick = ticks[low - 1]!;
    const endTick = ticks[low];
    if (endTick === undefined && timeS - startTick.timeS > keepS) return;
    const start = this.decode(stream, startTick);
    const continues = (from: RecordedTick | undefined,
                       to: RecordedTick | undefined): to is RecordedTick =>
        from !== undefined && to !== undefined && from.epoch === to.epoch &&
        from.jointCount === to.jointCount;
    const exact = startTick.timeS === timeS;
    const end = !exact && continues(startTick, endTick) ? this.decode(stream, endTick) : null;
    const beforeTick = low - 2 >= first ? ticks[low - 2] : undefined;
    const before = end !== null && continues(beforeTick, startTick)
        ? this.decode(stream, beforeTick!) : null;
    const beyondTick = ticks[low + 1];
    const beyond = end !== null && continues(endTick, beyondTick)
        ? this.decode(stream, beyondTick) : null;
    this.neighbours.push({start, exact, end, before, beyond});

    out.jointCount = startTick.jointCount;
    reserve(out, out.count + start.count, startTick.jointCount);
    for (let i = 0; i < start.count; ++i) {
      const avatar = start.avatars[i]!;
      if (!this.wants(avatar) || this.outIndices.has(avatar)) continue;
      this.outIndices.set(avatar, 0);
      out.avatars[out.count++] = avatar;
    }
  }

  /** Writes the poses of a stream's avatars at a time to `out`. */
  private interpolateStream({start, exact, end, before, beyond}: Neighbours, timeS: number,
                            out: CrowdPose): void {
    const jointCount = start.source!.jointCount;
    if (jointCount !== out.jointCount) return;
    for (let i = 0; i < start.count; ++i) {
      const avatar = start.avatars[i]!;
      const outIndex = this.outIndices.get(avatar);
      if (outIndex === undefined) continue;
      const lasting = start.flags[i]! & lastingFlags;
      const j = end?.indices.get(avatar);
      if (j === undefined || (end!.flags[j]! & PoseFlag.discontinuity) !== 0) {
        copyPose(start.roots, start.rotations, i, jointCount, out.rootsM, 3 * outIndex,
                 out.rotations, 4 * jointCount * outIndex);
        out.flags[outIndex] = exact ? start.flags[i]! : lasting | PoseFlag.held;
        continue;
      }
      const b = (start.flags[i]! & PoseFlag.discontinuity) === 0 ? before?.indices.get(avatar)
                                                                 : undefined;
      let n = beyond?.indices.get(avatar);
      if (n !== undefined && (beyond!.flags[n]! & PoseFlag.discontinuity) !== 0) n = undefined;
      this.setKey(0, b === undefined ? start : before!, b ?? i);
      this.setKey(1, start, i);
      this.setKey(2, end!, j);
      this.setKey(3, n === undefined ? end! : beyond!, n ?? j);
      interpolate(this.keys, timeS, jointCount, out.rootsM, 3 * outIndex, out.rotations,
                  4 * jointCount * outIndex);
      out.flags[outIndex] = lasting;
    }
  }

  private setKey(key: number, decoded: DecodedTick, index: number): void {
    this.keys.roots[key] = decoded.roots;
    this.keys.rotations[key] = decoded.rotations;
    this.keys.places[key] = index;
    this.keys.timesS[key] = decoded.source!.timeS;
  }

  /** Returns the poses of a tick from the cache, or decodes them into its least recently used
   * buffers. */
  private decode(stream: Stream, tick: RecordedTick): DecodedTick {
    let oldest: DecodedTick | null = null;
    for (const decoded of stream.decoded) {
      if (decoded.source === tick) {
        decoded.lastUse = ++this.useCount;
        return decoded;
      }
      if (oldest === null || decoded.lastUse < oldest.lastUse) oldest = decoded;
    }
    if (oldest === null || stream.decoded.length < maxDecodedTicks) {
      oldest = {
        source: null,
        lastUse: 0,
        count: 0,
        avatars: new Uint32Array(0),
        flags: new Uint8Array(0),
        roots: new Float32Array(0),
        rotations: new Float32Array(0),
        indices: new Map(),
      };
      stream.decoded.push(oldest);
    }
    const into = oldest;
    const jointCount = tick.jointCount;
    let count = 0;
    for (const part of tick.parts) count += part.avatars.length;
    if (into.avatars.length < count || into.rotations.length < 4 * count * jointCount) {
      into.avatars = new Uint32Array(count);
      into.flags = new Uint8Array(count);
      into.roots = new Float32Array(3 * count);
      into.rotations = new Float32Array(4 * count * jointCount);
    }
    into.source = null;
    into.indices.clear();
    let index = 0;
    for (const part of tick.parts) {
      const reader = new PoseReader(part);
      for (let i = 0; i < part.avatars.length; ++i) {
        // WorldView validates only the poses of observed avatars, so others may be invalid.
        if (!reader.read(i, into.roots, 3 * index, into.rotations, 4 * jointCount * index)) {
          continue;
        }
        into.avatars[index] = part.avatars[i]!;
        into.flags[index] = flagsOf(part.flags[i]!, part.mode);
        into.indices.set(part.avatars[i]!, index++);
      }
    }
    into.count = index;
    into.source = tick;
    into.lastUse = ++this.useCount;
    return into;
  }

  /** Drops the oldest ticks while the recording is too long or too large. */
  private dropOld(): void {
    for (;;) {
      let oldest: Stream | null = null;
      for (const stream of this.streams.values()) {
        const tick = stream.ticks[stream.first];
        if (tick !== undefined &&
            (oldest === null || tick.timeS < oldest.ticks[oldest.first]!.timeS)) {
          oldest = stream;
        }
      }
      if (oldest === null) return;
      const tick = oldest.ticks[oldest.first]!;
      if (tick.timeS >= this.newestS - this.lengthS && this.poseBytes <= this.maxBytes) return;
      this.poseBytes -= tick.bytes;
      oldest.ticks[oldest.first++] = undefined as never;  // Frees its memory.
      if (2 * oldest.first > oldest.ticks.length) {
        oldest.ticks = oldest.ticks.slice(oldest.first);
        oldest.first = 0;
      }
    }
  }
}
