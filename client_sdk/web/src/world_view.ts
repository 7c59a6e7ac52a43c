import {flagsOf, lastingFlags} from './pose_flags';
import {PoseHistory} from './pose_history';
import {reserve} from './room';
import {streamOf} from './stream_of';
import {PoseFlag, type CrowdPose, type Pose, type PoseKind} from './types';
import {maxItems} from './wire/limits';
import {Malformed} from './wire/malformed';
import type {PoseBatch} from './wire/messages';
import {PoseReader} from './wire/pose_codec';

/** Poses of an avatar that is gone can still be sampled for this long. */
const keepGoneS = 2;
/** How long it is remembered that an avatar has left: batches wait for a few ticks at most. */
const keepLeftTicks = 600;
const maxShards = 1024;

/** Memory that all pose histories of a client share. */
export interface PoseBudget {
  limitBytes: number;
  usedBytes: number;
}

export interface PoseCounts {
  batches: number;
  poses: number;
  refused: number;
  missing: number;
  /** Sampled beyond the newest received pose. */
  starved: number;
  decodeMs: number;
}

interface Track {
  readonly avatar: number;
  history: PoseHistory;
  /** Which shard and mode it was last seen in. */
  stream: number;
  seenTick: number;
  epoch: number;
  gone: boolean;
}

interface Shard {
  tick: number;
  partsSeen: number;
  epoch: number;
}

/** What is seen of a world: the poses of its avatars. */
export class WorldView {
  /** Joints of the figure; 0: not known yet. */
  jointCount = 0;
  private readonly tracks = new Map<number, Track>();
  private readonly shards = new Map<number, Shard>();
  private filter: ReadonlySet<number> | null = null;
  private epochNumber = 1;
  private list = new Uint32Array(0);
  private sorted: Track[] = [];
  private listIsOld = false;
  /** Grows when `avatars` gives another list. */
  version = 0;
  private newestS = -Infinity;
  /** Who has left the region observed, and since which tick; forgotten after a while. */
  private readonly left = new Map<number, number>();

  constructor(private readonly poseHistory: number, private readonly budget: PoseBudget,
              private readonly counts: PoseCounts, private readonly now: () => number) {}

  /** Grows with every break. */
  get epoch(): number {
    return this.epochNumber;
  }
  /** Of the newest pose received; -Infinity: none. */
  get newestTimeS(): number {
    return this.newestS;
  }

  /** Forgets the poses, and that of a figure with another number of joints none will be taken. */
  reset(jointCount: number): void {
    this.clearPoses();
    this.jointCount = jointCount;
  }

  clearPoses(): void {
    if (this.tracks.size > 0) this.changeList();
    for (const track of this.tracks.values()) this.release(track);
    this.tracks.clear();
    this.shards.clear();
    this.left.clear();
    this.newestS = -Infinity;
  }

  /** What comes next does not continue what was there before (a connection resumed, a subscription
   * begun), though the server cannot say so in a shared batch. */
  breakOff(): void {
    ++this.epochNumber;
  }

  /** Which avatars' poses to keep; null: all. */
  setFilter(filter: ReadonlySet<number> | null): void {
    this.filter = filter;
    if (filter === null) return;
    for (const [avatar, track] of this.tracks) {
      if (!filter.has(avatar)) this.erase(track);
    }
  }

  wants(avatar: number): boolean {
    return this.filter === null || this.filter.has(avatar);
  }

  /**
   * Takes in one batch; `everyNTicks` is the rate asked for, to count gaps.
   * @throws Malformed: a pose that is none, or another figure than announced; what came before it is
   *     kept.
   */
  take(batch: PoseBatch, everyNTicks: number): void {
    if (batch.jointCount !== this.jointCount) {
      throw new Malformed('is not that of the figure', 'PoseBatch.jointCount');
    }
    ++this.counts.batches;
    const stream = streamOf(batch);
    const shard = this.followShard(batch, everyNTicks);
    this.newestS = Math.max(this.newestS, batch.serverTimeS);

    const startedMs = this.now();
    const reader = new PoseReader(batch);
    for (let i = 0; i < batch.avatars.length; ++i) {
      const avatar = batch.avatars[i]!;
      if (this.filter !== null && !this.filter.has(avatar)) continue;
      const leftTick = this.left.get(avatar);
      if (leftTick !== undefined && batch.tick < leftTick) continue;
      const track = this.tracks.get(avatar) ?? this.begin(avatar, stream);
      if (track === null) {
        ++this.counts.refused;
        continue;
      }
      const history = track.history;
      if (history.accepts(batch.tick, batch.serverTimeS)) {
        const slot = history.nextSlot();
        if (!reader.read(i, history.roots, 3 * slot, history.rotations,
                         4 * slot * this.jointCount)) {
          throw new Malformed('is no pose', 'PoseBatch.poses', i);
        }
        let flags = flagsOf(batch.flags[i]!, batch.mode);
        if (track.epoch !== this.epochNumber) flags |= PoseFlag.discontinuity;
        history.commit(batch.tick, batch.serverTimeS, flags);
        ++this.counts.poses;
        track.epoch = this.epochNumber;
        if (track.gone) {
          track.gone = false;
          this.changeList();
        }
      } else if (batch.tick !== track.seenTick) {  // Equal ticks are a second subscription's.
        ++this.counts.refused;
      }
      track.stream = stream;
      track.seenTick = batch.tick;
    }
    this.counts.decodeMs += this.now() - startedMs;
    if (shard.partsSeen >= batch.parts) this.sweep(stream, batch);
  }

  /** It has left the region observed at that tick; poses from before it that are still on their way do not bring it
   * back. */
  leave(avatar: number, tick: number): void {
    this.remove(avatar);
    if (this.left.has(avatar) || this.left.size < maxItems) this.left.set(avatar, tick);
  }

  /** The server said that the avatar is gone. */
  remove(avatar: number): void {
    const track = this.tracks.get(avatar);
    if (track !== undefined && !track.gone) {
      track.gone = true;
      this.changeList();
    }
  }

  /** Those that are there, in growing order. */
  avatars(): Uint32Array {
    if (this.listIsOld) {
      this.listIsOld = false;
      this.sorted = [...this.tracks.values()].sort((a, b) => a.avatar - b.avatar);
      this.list = Uint32Array.from(
          this.sorted.filter((track) => !track.gone), (track) => track.avatar);
    }
    return this.list;
  }

  sample(avatar: number, timeS: number, out: Pose): PoseKind {
    const track = this.tracks.get(avatar);
    if (track === undefined || track.history.size === 0) return 'missing';
    const history = track.history;
    if (track.gone && timeS > history.newestTimeS) return 'missing';
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
    out.detail = (flags & PoseFlag.fewerJoints) !== 0 ? 'fewer' : (flags & PoseFlag.rootOnly) !== 0 ? 'root' : 'all';
    out.heldS = found === 2 ? timeS - history.timeOf(slot) : 0;
    if (found === 2 && timeS > history.newestTimeS) ++this.counts.starved;
    return found === 1 ? 'interpolated' : 'held';
  }

  sampleAll(timeS: number, out: CrowdPose): number {
    this.avatars();
    const jointCount = this.jointCount;
    reserve(out, this.sorted.length, jointCount);
    let count = 0;
    for (const track of this.sorted) {
      const history = track.history;
      if (history.size === 0 || (track.gone && timeS > history.newestTimeS)) continue;
      const found = history.sample(timeS, out.rootsM, 3 * count, out.rotations,
                                   4 * jointCount * count);
      if (found === 0) continue;
      const slot = history.sampledSlot;
      const lasting = history.flagsOf(slot) & lastingFlags;
      out.avatars[count] = track.avatar;
      out.flags[count] = found === 2
          ? lasting | PoseFlag.held
          : lasting | (history.timeOf(slot) === timeS ? history.flagsOf(slot) : 0);
      if (found === 2 && timeS > history.newestTimeS) ++this.counts.starved;
      ++count;
    }
    out.count = count;
    out.jointCount = jointCount;
    return count;
  }

  private followShard(batch: PoseBatch, everyNTicks: number): Shard {
    const key = streamOf(batch);
    let shard = this.shards.get(key);
    if (shard === undefined) {
      if (this.shards.size === maxShards) {
        throw new Malformed('poses come from too many shards', 'PoseBatch.shard');
      }
      shard = {tick: 0, partsSeen: 0, epoch: 0};
      this.shards.set(key, shard);
    }
    if (shard.epoch !== this.epochNumber) {
      shard.tick = batch.tick;
      shard.partsSeen = 0;
      shard.epoch = this.epochNumber;
    } else if (batch.tick > shard.tick) {
      // Of a region nothing comes at ticks at which nobody is due.
      if (!batch.partial && everyNTicks > 0 && batch.tick - shard.tick > everyNTicks) {
        this.counts.missing += Math.floor((batch.tick - shard.tick - 1) / everyNTicks);
      }
      shard.tick = batch.tick;
      shard.partsSeen = 0;
    } else if (batch.tick < shard.tick) {
      throw new Malformed('ticks of a shard run backwards', 'PoseBatch.tick');
    }
    ++shard.partsSeen;
    return shard;
  }

  private begin(avatar: number, stream: number): Track | null {
    const bytes = PoseHistory.bytes(this.poseHistory, this.jointCount);
    if (this.budget.usedBytes + bytes > this.budget.limitBytes) return null;
    this.budget.usedBytes += bytes;
    const history = new PoseHistory(this.poseHistory, this.jointCount);
    const track = {avatar, history, stream, seenTick: -1, epoch: 0, gone: false};
    this.tracks.set(avatar, track);
    this.changeList();
    return track;
  }

  /** After the last part of a shard's batch: who was not in it, but in one before, is gone. */
  private sweep(stream: number, {tick, serverTimeS: timeS, partial}: PoseBatch): void {
    for (const [avatar, leftTick] of partial ? this.left : []) {
      if (leftTick + keepLeftTicks < tick) this.left.delete(avatar);
    }
    for (const track of this.tracks.values()) {
      if (!partial && track.stream === stream && track.seenTick < tick && !track.gone) {
        track.gone = true;
        this.changeList();
      }
      if (track.gone && track.history.size > 0 && timeS - track.history.newestTimeS > keepGoneS) {
        this.erase(track);
      }
    }
  }

  private changeList(): void {
    this.listIsOld = true;
    ++this.version;
  }

  private erase(track: Track): void {
    this.release(track);
    this.tracks.delete(track.avatar);
    this.listIsOld = true;
    if (!track.gone) ++this.version;
  }

  private release(track: Track): void {
    this.budget.usedBytes -= PoseHistory.bytes(this.poseHistory, track.history.jointCount);
  }
}
