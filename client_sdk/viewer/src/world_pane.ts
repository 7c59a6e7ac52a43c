import type {WorldView} from './scene/world_view.js';
import type {Subscription, World} from './sdk.js';
import type {Wander} from './random_walkers.js';

/** A world on the page. */
export interface Shown {
  readonly world: World;
  readonly view: WorldView;
  subscription: Subscription | null;
  wander: Wander | null;
  /** Avatars that this page has put there. */
  readonly ours: Set<number>;
}

export interface Chosen {
  readonly shown: Shown;
  readonly avatar: number;
}
