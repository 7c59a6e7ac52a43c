import type {RandomWalkers} from './random_walkers.js';
import type {WorldView} from './scene/world_view.js';
import type {Subscription, World} from './sdk.js';

/** A world that the page shows: its part of the page, its scene and its subscription. */
export interface WorldPane {
  readonly world: World;
  readonly view: WorldView;
  subscription: Subscription | null;
  /** True if the server has accepted the subscription. */
  subscribed: boolean;
  /** Avatars of this world that this page moves at random. Null until there are any. */
  randomWalkers: RandomWalkers | null;
  /** Ids of the avatars that this page has spawned. */
  readonly ownAvatars: Set<number>;
  /** The server's reason for not letting this page join the world; empty if it has not refused. */
  refusal: string;
}

/** The avatar that the user has selected. */
export interface AvatarSelection {
  readonly pane: WorldPane;
  readonly avatar: number;
}
