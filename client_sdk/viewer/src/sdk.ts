// The parts of `@stridewire/client` that the viewer uses. All other files import them from here.

export {Client, createCrowdPose} from '@stridewire/client';
export type {
  CrowdPose, HeightField, MovementRequest, PoseDetail, PoseMode, QueuedRequest, Reply, Statistics,
  Subscription, Terrain, TerrainBox, Vec3, World, WorldEvent,
} from '@stridewire/client';

import type {World} from '@stridewire/client';

/** An avatar's current movement and queue: the server's answer to `World.inspect`. */
export type AvatarState = NonNullable<Awaited<ReturnType<World['inspect']>>>;
export type MovementState = NonNullable<AvatarState['movement']>;
