import {streamOf} from './batch_stream';
import {reserve} from './pose_buffers';
import {flagsOf, lastingFlags} from './pose_flags';
import {PoseHistory} from './pose_history';
import {PoseFlag, type CrowdPose, type Pose, type PoseKind} from './types';
import {maxItems} from '../generated/limits';
import {Malformed} from './wire/malformed';
import type {DecodableBatch as PoseBatch} from './wire/messages';
import {PoseReader} from './wire/pose_codec';

/** Time for which the poses of a removed avatar can still be sampled. */
const keepRemovedS = 2;
/**
 * Time for which the view remembers that an avatar left the region. Late poses arrive within a few
 * ticks.
 */
const keepLeftTicks = 600;
const maxStreams = 1024;

/** Memory for the pose histories of all worlds of a client. */
export interface PoseBudget {
  limitBytes: number;
  usedBytes: number;
}

export interface PoseCounts {
  batches: number;
  poses: number;
  refused: number;
  missing: number;
  /** Number of samples for times after the newest received pose of their avatar. */
  held: number;
  decodeMs: number;
}

interface Track {
  readonly avatar: number;
  history: PoseHistory;
  /** Stream of the avatar's last batch, see `streamOf`. */
  stream: number;
  /** Tick of the avatar's last batch. */
  lastTick: number;
  /** Epoch of the avatar's last pose. */
  epoch: number;
  removed: boolean;
}

/** Progress of a stream, see `streamOf`. */
interface StreamState {
  tick: number;
  /** Number of parts of the tick's batch that have arrived. */
  partCount: number;
  epoch: number;
}

/** The avatars of a world and their received poses. */
export class WorldView {
  /** Number of joints of the skeleton; 0 until it is known. */
  jointCount = 0;
  private readonly tracks = new Map<number, Track>();
  private readonly streams = new Map<number, StreamState>();
  private filter: ReadonlySet<number> | null = null;
  private epochNumber = 1;
  private list = new Uint32Array(0);
  private sorted: Track[] = [];
  private listIsOutdated = false;
  /** Changes whenever the result of `avatars` changes. */
  version = 0;
  private newestS = -Infinity;
  /** Tick at which each avatar left the observed region. Entries expire after `keepLeftTicks`. */
  private readonly left = new Map<number, number>();

  constructor(private readonly poseHistory: number, private readonly budget: PoseBudget,
              private readonly counts: PoseCounts, private readonly now: () => number) {}

  /** Poses of different epochs are not interpolated, see `startNewEpoch`. */
  get epoch(): number {
    return this.epochNumber;
  }
  /** Server time of the newest received batch; -Infinity if there is none. */
  get newestTimeS(): number {
    return this.newestS;
  }

  /** Discards all poses. From now on, poses must have `jointCount` joints. */
  reset(jointCount: number): void {
    this.clearPoses();
    this.jointCount = jointCount;
  }

  /** Discards all poses. */
  clearPoses(): void {
    if (this.tracks.size > 0) this.markListOutdated();
    for (const track of this.tracks.values()) this.release(track);
    this.tracks.clear();
    this.streams.clear();
    this.left.clear();
    this.newestS = -Infinity;
  }

  /**
   * Marks the next pose of each avatar as discontinuous, for example after a reconnect or a new
   * subscription. The server cannot set this flag, because other clients receive the same batch.
   */
  startNewEpoch(): void {
    ++this.epochNumber;
  }

  /** Restricts stored poses to these avatars and discards others; null: all avatars. */
  setFilter(filter: ReadonlySet<number> | null): void {
    this.filter = filter;
    if (filter === null) return;
    for (const [avatar, track] of this.tracks) {
      if (!filter.has(avatar)) this.erase(track);
    }
  }

  /** Returns whether the filter admits the avatar. */
  wants(avatar: number): boolean {
    return this.filter === null || this.filter.has(avatar);
  }

  /**
   * Decodes and stores the poses of a batch. `everyNTicks` is the requested number of ticks per
   * pose, for counting missing batches; 0 disables the count.
   * @throws Malformed a pose is invalid or has the wrong number of joints. Earlier poses of the
   *     batch stay stored.
   */
  addBatch(batch: PoseBatch, everyNTicks: number): void {
    if (batch.jointCount !== this.jointCount) {
      throw new Malformed('differs from the skeleton', 'PoseBatch.jointCount');
    }
    ++this.counts.batches;
    const stream = streamOf(batch);
    const {partCount} = this.updateStream(batch, everyNTicks);
    this.newestS = Math.max(this.newestS, batch.serverTimeS);

    const startedMs = this.now();
    const reader = new PoseReader(batch);
    for (let i = 0; i < batch.avatars.length; ++i) {
      const avatar = batch.avatars[i]!;
      if (this.filter !== null && !this.filter.has(avatar)) continue;
      const leftTick = this.left.get(avatar);
      if (leftTick !== undefined && batch.tick < leftTick) continue;
      const track = this.tracks.get(avatar) ?? this.addTrack(avatar, stream);
      if (track === null) {
        ++this.counts.refused;
        continue;
      }
      const history = track.history;
      if (history.accepts(batch.tick, batch.serverTimeS)) {
        const slot = history.nextSlot();
        if (!reader.read(i, history.roots, 3 * slot, history.rotations,
                         4 * slot * this.jointCount)) {
          throw new Malformed('is not a valid pose', 'PoseBatch.poses', i);
        }
        let flags = flagsOf(batch.flags[i]!, batch.mode);
        if (track.epoch !== this.epochNumber) flags |= PoseFlag.discontinuity;
        history.commit(batch.tick, batch.serverTimeS, flags);
        ++this.counts.poses;
        track.epoch = this.epochNumber;
        if (track.removed) {
          track.removed = false;
          this.markListOutdated();
        }
      } else if (batch.tick !== track.lastTick) {
        // A repeated tick is not counted, because two subscriptions may contain the same avatar.
        ++this.counts.refused;
      }
      track.stream = stream;
      track.lastTick = batch.tick;
    }
    this.counts.decodeMs += this.now() - startedMs;
    if (partCount >= batch.parts) this.removeAbsent(stream, batch);
  }

  /** Removes an avatar that left the observed region at this tick. Older poses that arrive later do
   * not add it again. */
  leave(avatar: number, tick: number): void {
    this.remove(avatar);
    if (this.left.has(avatar) || this.left.size < maxItems) this.left.set(avatar, tick);
  }

  /** Removes an avatar from `avatars`. Its poses can still be sampled for a while. */
  remove(avatar: number): void {
    const track = this.tracks.get(avatar);
    if (track !== undefined && !track.removed) {
      track.removed = true;
      this.markListOutdated();
    }
  }

  /** Returns the ids of the current avatars, ascending. A change replaces the array. */
  avatars(): Uint32Array {
    if (this.listIsOutdated) {
      this.listIsOutdated = false;
      this.sorted = [...this.tracks.values()].sort((a, b) => a.avatar - b.avatar);
      this.list = Uint32Array.from(
          this.sorted.filter((track) => !track.removed), (track) => track.avatar);
    }
    return this.list;
  }

  /** See `World.sample`. */
  sample(avatar: number, timeS: number, out: Pose): PoseKind {
    const track = this.tracks.get(avatar);
    if (track === undefined || track.history.size === 0) return 'missing';
    const history = track.history;
    if (track.removed && timeS > history.newestTimeS) return 'missing';
    if (out.rotations.length < 4 * history.jointCount) {
      out.rotations = new Float32Array(4 * history.jointCount);
    }
    const found = history.sample(timeS, out.rootM, 0, out.rotations, 0);
    if (found === 0) return 'missing';
    const slot = history.sampledSlot;
    out.jointCount = history.jointCount;
    out.tick = history.tickOf(slot);
    const flags = history.flagsOf(slot);
    out.standing = (flags & PoseFlag.standing) !== 0;
    out.detail = (flags & PoseFlag.reducedJoints) !== 0 ? 'reduced'
        : (flags & PoseFlag.rootOnly) !== 0 ? 'root' : 'all';
    out.heldS = found === 2 ? timeS - history.timeOf(slot) : 0;
    if (found === 2 && timeS > history.newestTimeS) ++this.counts.held;
    return found === 1 ? 'interpolated' : 'held';
  }

  /** See `World.sampleAll`. */
  sampleAll(timeS: number, out: CrowdPose): number {
    this.avatars();
    const jointCount = this.jointCount;
    reserve(out, this.sorted.length, jointCount);
    let count = 0;
    for (const track of this.sorted) {
      const history = track.history;
      if (history.size === 0 || (track.removed && timeS > history.newestTimeS)) continue;
      const found = history.sample(timeS, out.rootsM, 3 * count, out.rotations,
                                   4 * jointCount * count);
      if (found === 0) continue;
      const slot = history.sampledSlot;
      const lasting = history.flagsOf(slot) & lastingFlags;
      out.avatars[count] = track.avatar;
      out.flags[count] = found === 2
          ? lasting | PoseFlag.held
          : lasting | (history.timeOf(slot) === timeS ? history.flagsOf(slot) : 0);
      if (found === 2 && timeS > history.newestTimeS) ++this.counts.held;
      ++count;
    }
    out.count = count;
    out.jointCount = jointCount;
    return count;
  }

  private updateStream(batch: PoseBatch, everyNTicks: number): StreamState {
    const key = streamOf(batch);
    let stream = this.streams.get(key);
    if (stream === undefined) {
      if (this.streams.size === maxStreams) {
        throw new Malformed('poses come from too many shards', 'PoseBatch.shard');
      }
      stream = {tick: 0, partCount: 0, epoch: 0};
      this.streams.set(key, stream);
    }
    if (stream.epoch !== this.epochNumber) {
      stream.tick = batch.tick;
      stream.partCount = 0;
      stream.epoch = this.epochNumber;
    } else if (batch.tick > stream.tick) {
      // For a region, the server sends no batch at a tick at which no avatar is due.
      if (!batch.partial && everyNTicks > 0 && batch.tick - stream.tick > everyNTicks) {
        this.counts.missing += Math.floor((batch.tick - stream.tick - 1) / everyNTicks);
      }
      stream.tick = batch.tick;
      stream.partCount = 0;
    } else if (batch.tick < stream.tick) {
      throw new Malformed('ticks of a shard run backwards', 'PoseBatch.tick');
    }
    ++stream.partCount;
    return stream;
  }

  /** Returns null if the memory limit is reached. */
  private addTrack(avatar: number, stream: number): Track | null {
    const bytes = PoseHistory.bytes(this.poseHistory, this.jointCount);
    if (this.budget.usedBytes + bytes > this.budget.limitBytes) return null;
    this.budget.usedBytes += bytes;
    const history = new PoseHistory(this.poseHistory, this.jointCount);
    const track = {avatar, history, stream, lastTick: -1, epoch: 0, removed: false};
    this.tracks.set(avatar, track);
    this.markListOutdated();
    return track;
  }

  /** Removes avatars that are missing from the complete batch of their stream. Erases avatars that
   * were removed more than `keepRemovedS` ago. */
  private removeAbsent(stream: number, {tick, serverTimeS: timeS, partial}: PoseBatch): void {
    for (const [avatar, leftTick] of partial ? this.left : []) {
      if (leftTick + keepLeftTicks < tick) this.left.delete(avatar);
    }
    for (const track of this.tracks.values()) {
      if (!partial && track.stream === stream && track.lastTick < tick && !track.removed) {
        track.removed = true;
        this.markListOutdated();
      }
      if (track.removed && track.history.size > 0 &&
          timeS - track.history.newestTimeS > keepRemovedS) {
        this.erase(track);
      }
    }
  }

  private markListOutdated(): void {
    this.listIsOutdated = true;
    ++this.version;
  }

  private erase(track: Track): void {
    this.release(track);
    this.tracks.delete(track.avatar);
    this.listIsOutdated = true;
    if (!track.removed) ++this.version;
  }

  private release(track: Track): void {
    this.budget.usedBytes -= PoseHistory.bytes(this.poseHistory, track.history.jointCount);
  }
}
