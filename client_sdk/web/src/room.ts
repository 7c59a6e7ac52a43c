import type {CrowdPose, Pose} from './types';

/** Room for one pose. */
export function createPose(jointCount = 0): Pose {
  return {
    rotations: new Float32Array(4 * jointCount),
    rootM: new Float32Array(3),
    jointCount,
    tick: 0,
    standing: false,
    detail: 'all',
    heldS: 0,
  };
}

/** Room for the poses of a crowd. */
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

/** @internal Makes `out` large enough for `count` figures. */
export function reserve(out: CrowdPose, count: number, jointCount: number): void {
  if (out.avatars.length < count) {
    // A quarter more, so that a growing crowd does not make new arrays with every avatar.
    const room = Math.ceil(count * 1.25);
    out.avatars = grown(new Uint32Array(room), out.avatars);
    out.flags = grown(new Uint8Array(room), out.flags);
    out.rootsM = grown(new Float32Array(3 * room), out.rootsM);
  }
  if (out.rotations.length < 4 * count * jointCount) {
    out.rotations = grown(new Float32Array(4 * out.avatars.length * jointCount), out.rotations);
  }
}

function grown<T extends Uint32Array | Uint8Array | Float32Array>(to: T, from: T): T {
  to.set(from as never);
  return to;
}
