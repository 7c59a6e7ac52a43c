import {Listeners} from './listeners';
import {MemoryView, native} from './native';
import {CrowdReader} from './pose_buffers';
import {WorldRecording} from './recording';
import type {Session} from './session';
import {
  PoseFlag, type CrowdPose, type Pose, type PoseKind, type Recording, type Reply, type Role,
  type Skeleton, type Terrain, type World, type WorldListeners, type WorldState
} from './types';
import type {WorldInfo} from '../generated/messages';
import * as commands from './wire/commands';
import type {Draft} from './wire/frame';

/**
 * A world, with the state that the session keeps for it. Applications use only the interface
 * `World`.
 */
export class WorldHandle implements World {
  state: WorldState = 'pending';
  skeleton: Skeleton | null = null;
  libraryHash = '';
  layers: readonly string[] = [];
  terrain: Terrain | null = null;
  joined!: Promise<Reply>;
  readonly record: WorldRecording;

  // The fields below belong to the session.
  readonly listeners = new Listeners<WorldListeners>();
  /** The world's number in the WebAssembly module; 0 if the module has refused it. */
  handle = 0;
  /** Number of events that the server has dropped since the join, from its last report. */
  reportedDroppedEvents = 0;
  /** Revision of the avatars in the last notification to listeners. */
  revision = 0;
  /** The skeleton in the last WorldInfo as JSON, to detect changes. */
  private skeletonText = '';
  private list = new Uint32Array(0);
  private listRevision = 0;

  private readonly crowds = new CrowdReader();
  private readonly roots = new MemoryView(Float32Array);
  private readonly rotations = new MemoryView(Float32Array);

  constructor(private readonly session: Session, readonly name: string, readonly role: Role,
              recordingS: number, maxRecordedEvents: number) {
    this.record = new WorldRecording(this, recordingS, maxRecordedEvents);
  }

  get recording(): Recording {
    return this.record;
  }

  spawn: World['spawn'] = (items) => this.send({type: 'Spawn', items});
  remove: World['remove'] = (avatars) => this.send({type: 'Remove', avatars});
  cancel: World['cancel'] = (avatars) => this.send({type: 'CancelQueue', avatars});
  request: World['request'] = (items) => this.session.command(
      this, () => commands.request(items, () => this.session.nextRequestId++));
  setTerrain: World['setTerrain'] = (terrain) => this.send({type: 'SetTerrain', terrain});
  setLayers: World['setLayers'] = (items) => this.send({type: 'SetLayers', items});
  setPlanting: World['setPlanting'] = (avatars, enabled) =>
      this.send({type: 'SetPlanting', avatars, enabled});
  observe: World['observe'] = (observation) => this.session.observe(this, observation);
  inspect: World['inspect'] = (avatar) => this.session.inspect(this, avatar);
  leave: World['leave'] = () => this.send({type: 'LeaveWorld'});
  on: World['on'] = (name, listener) => this.listeners.on(name, listener);

  private send(message: Draft): Promise<Reply> {
    return this.session.command(this, () => message);
  }

  avatars(): Uint32Array {
    const revision = this.stateNumbers()?.[0] ?? 0;
    if (revision !== this.listRevision) {
      this.listRevision = revision;
      const count = native().call.avatars(this.session.client, this.handle);
      this.list = new Uint32Array(native().memoryBuffer, native().results[0], count).slice();
    }
    return this.list;
  }

  sample(avatar: number, timeS: number, out: Pose): PoseKind {
    this.session.recordSample(this, timeS);
    const kind = native().call.sample(this.session.client, this.handle, avatar, timeS);
    if (kind === 0) return 'missing';
    const [joints, rootAt, rotationsAt, tick, flags, heldS, segment] = native().results;
    if (out.rotations.length < 4 * joints!) out.rotations = new Float32Array(4 * joints!);
    out.rootM.set(this.roots.get(rootAt!, 3));
    out.rotations.set(this.rotations.get(rotationsAt!, 4 * joints!));
    out.jointCount = joints!;
    out.tick = tick!;
    out.standing = (flags! & PoseFlag.standing) !== 0;
    out.detail = (flags! & PoseFlag.reducedJoints) !== 0 ? 'reduced'
        : (flags! & PoseFlag.rootOnly) !== 0 ? 'root' : 'all';
    out.heldS = heldS!;
    out.segment = segment!;
    return kind === 1 ? 'interpolated' : kind === 2 ? 'held' : 'extrapolated';
  }

  sampleAll(timeS: number, out: CrowdPose): number {
    this.session.recordSample(this, timeS);
    return this.sampleCrowd(timeS, out, false);
  }

  sampleCrowd(timeS: number, out: CrowdPose, recorded: boolean): number {
    return this.crowds.read(
        native().call.sample_all(this.session.client, this.handle, timeS, Number(recorded)), out);
  }

  clearPoseRecording(): void {
    native().call.clear_recording(this.session.client, this.handle);
  }

  /** Returns the results of `world_state`, or null if the module does not know this world. */
  stateNumbers(): Float64Array | null {
    return native().call.world_state(this.session.client, this.handle) < 0 ? null
                                                                           : native().results;
  }

  /** Applies a WorldInfo message. */
  setInfo(info: WorldInfo): void {
    const text = JSON.stringify(info.skeleton);
    if (this.skeleton === null || text !== this.skeletonText) {
      this.record.clearEvents();
      this.skeleton = toSkeleton(info);
      this.skeletonText = text;
    }
    this.libraryHash = info.libraryHash;
    this.layers = info.layers;
  }

  /** Discards everything that the server has sent about the world. */
  reset(): void {
    this.reportedDroppedEvents = 0;
    this.record.clearEvents();
    this.skeleton = null;
    this.libraryHash = '';
    this.layers = [];
  }
}

function toSkeleton({skeleton}: WorldInfo): Skeleton {
  const {joints, endSites, leftLeg, rightLeg} = skeleton;
  const jointCount = joints.length;
  const offsetsM = new Float32Array(3 * jointCount);
  joints.forEach((joint, j) => offsetsM.set(joint.offsetM, 3 * j));
  return {
    jointCount,
    names: joints.map((joint) => joint.name),
    parents: Int16Array.from(joints, (joint) => joint.parent),
    offsetsM,
    endSites,
    leftLeg,
    rightLeg,
  };
}
