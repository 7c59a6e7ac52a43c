import {MemoryView, native} from './native';
import type {CrowdPose, Pose} from './types';

/**
 * Creates an output buffer for `World.sample`. `World.sample` enlarges it if the skeleton has more
 * joints.
 */
export function createPose(jointCount = 0): Pose {
  return {
    rotations: new Float32Array(4 * jointCount),
    rootM: new Float32Array(3),
    jointCount,
    tick: 0,
    standing: false,
    detail: 'all',
    heldS: 0,
    segment: 0,
  };
}

/** Creates an output buffer for `sampleAll`. `count` avatars fit into it without reallocation. */
export function createCrowdPose(count = 0, jointCount = 0): CrowdPose {
  const out = {
    count: 0,
    jointCount,
    avatars: new Uint32Array(0),
    flags: new Uint8Array(0),
    rootsM: new Float32Array(0),
    rotations: new Float32Array(0),
  };
  reserve(out, count, jointCount);
  return out;
}

/** Replaces arrays of `out` that are too small for `count` avatars. */
function reserve(out: CrowdPose, count: number, jointCount: number): void {
  if (out.avatars.length < count) {
    // Allocates a quarter more than necessary, so that a growing crowd does not reallocate for
    // every avatar.
    const capacity = Math.ceil(count * 1.25);
    out.avatars = new Uint32Array(capacity);
    out.flags = new Uint8Array(capacity);
    out.rootsM = new Float32Array(3 * capacity);
  }
  if (out.rotations.length < 4 * count * jointCount) {
    out.rotations = new Float32Array(4 * out.avatars.length * jointCount);
  }
}

/**
 * Copies the poses of crowds out of the WebAssembly module, because views of the module's memory
 * become invalid when it grows. @internal
 */
export class CrowdReader {
  private readonly ids = new MemoryView(Uint32Array);
  private readonly flags = new MemoryView(Uint8Array);
  private readonly roots = new MemoryView(Float32Array);
  private readonly rotations = new MemoryView(Float32Array);

  /** Copies the `count` poses that a function has returned (client_module.cpp, `sample_all`). */
  read(count: number, out: CrowdPose): number {
    const {results} = native();
    const joints = results[0]!;
    reserve(out, count, joints);
    out.avatars.set(this.ids.get(results[1]!, count));
    out.flags.set(this.flags.get(results[2]!, count));
    out.rootsM.set(this.roots.get(results[3]!, 3 * count));
    out.rotations.set(this.rotations.get(results[4]!, 4 * joints * count));
    out.count = count;
    out.jointCount = joints;
    return count;
  }
}
