import type {AvatarState, WorldEvent} from '../types';
import {enums, type AvatarState as AvatarStateMessage, type Event} from '../../generated/messages';

/** Functions that convert messages to those public types that differ from the schema. */

export function eventOf(event: Event): WorldEvent {
  const isRejectedStep =
      event.type === 'rejected' && (event.kind === 'stepLeft' || event.kind === 'stepRight');
  return event.type === 'footStrike' || isRejectedStep ? event : {...event, foot: null};
}

export function avatarStateOf(message: AvatarStateMessage): AvatarState {
  const {type: _, nonce: _nonce, world: _world, code: _code, text: _text, ...state} = message;
  const {movement} = state;
  return {
    ...state,
    movement: movement && {
      ...movement,
      endTimeS: movement.startTimeS + (movement.keytimesS.at(-1) ?? 0),
      parameterNames: Array.from(movement.parameterNames, (name) => enums.ParameterName[name]!),
    },
  };
}
