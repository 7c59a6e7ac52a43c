import {initialWalkerCount} from './avatar_commands.js';
import {button, h} from './dom.js';

/** A card that offers to spawn avatars. The page shows it while a world is empty. */
export class EmptyWorldCard {
  readonly element = h('div', {class: 'card'});

  constructor(private readonly spawn: () => void) {
    this.element.hidden = true;
  }

  /** `worldName` is the name of the empty world, or null to hide the card. */
  update(worldName: string | null): void {
    if (this.element.hidden === (worldName === null)) return;
    this.element.hidden = worldName === null;
    if (worldName === null) return;
    this.element.replaceChildren(
      h('h2', {}, 'This world is empty'),
      h('p', {}, `Spawn ${initialWalkerCount} avatars in ${worldName} that walk at random. ` +
        'The server removes them when this page closes.'),
      button(`Spawn ${initialWalkerCount} avatars`, {icon: 'randomWalk', class: 'primary'},
        () => this.spawn()));
  }
}
