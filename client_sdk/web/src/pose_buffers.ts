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

/** Enlarges `out` until `count` avatars fit into it. Keeps its contents. @internal */
export function reserve(out: CrowdPose, count: number, jointCount: number): void {
  if (out.avatars.length < count) {
    // Allocates a quarter more than necessary, so that a growing crowd does not reallocate for
    // every avatar.
    const capacity = Math.ceil(count * 1.25);
    out.avatars = copyInto(new Uint32Array(capacity), out.avatars);
    out.flags = copyInto(new Uint8Array(capacity), out.flags);
    out.rootsM = copyInto(new Float32Array(3 * capacity), out.rootsM);
  }
  if (out.rotations.length < 4 * count * jointCount) {
    out.rotations = copyInto(new Float32Array(4 * out.avatars.length * jointCount), out.rotations);
  }
}

function copyInto<T extends Uint32Array | Uint8Array | Float32Array>(to: T, from: T): T {
  to.set(from as never);
  return to;
}
