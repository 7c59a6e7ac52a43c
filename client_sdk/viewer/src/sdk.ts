// What the viewer uses of `@stridewire/client`, in one place.

export {Client, createCrowdPose} from '@stridewire/client';
export type {
  CrowdPose, HeightField, MovementRequest, Parameters, PoseDetail, PoseMode, QueuedRequest, Reply, Skeleton, Statistics,
  Subscription, Terrain, TerrainBox, Vec3, World, WorldEvent,
} from '@stridewire/client';

import type {World} from '@stridewire/client';

/** What an avatar does now and why, as the server tells when asked. */
export type AvatarState = NonNullable<Awaited<ReturnType<World['inspect']>>>;
export type MovementState = NonNullable<AvatarState['movement']>;
