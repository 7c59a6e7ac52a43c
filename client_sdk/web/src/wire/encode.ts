import {Builder} from 'flatbuffers';
import * as wire from '../../generated/wire';
import {footChoices, movementTypes, poseModes, roles} from './decode';
import {makeFrame, maxPayloadBytes} from './frame';
import {maxBulkBytes, maxControlBytes} from './limits';
import {Malformed} from './malformed';
import type {ClientMessage} from './messages';

/** Makes frames of checked messages; sender's limits are those of the server it talks to. */
export class Encoder {
  private readonly builder = new Builder(1024);

  constructor(private readonly controlBytes = maxControlBytes,
              private readonly bulkBytes = maxBulkBytes) {}

  /** @throws Malformed: the message is larger than the server takes. */
  encode(message: ClientMessage): ArrayBuffer {
    const b = this.builder;
    b.clear();
    b.finish(build(b, message));
    const bytes = b.asUint8Array();
    if (bytes.length > maxPayloadBytes(message.type, this.controlBytes, this.bulkBytes)) {
      throw new Malformed(`${bytes.length} bytes are more than the server takes`, message.type);
    }
    return makeFrame(message.type, bytes);
  }
}

function build(b: Builder, m: ClientMessage): number {
  switch (m.type) {
    case 'Hello': {
      const name = b.createString(m.clientName);
      const auth = b.createString(m.authToken);
      const token = wire.Hello.createResumeTokenVector(b, m.resumeToken);
      return wire.Hello.createHello(b, m.protocolMin, m.protocolMax, name, m.features, auth, token,
                                    m.lastEventsNumber);
    }
    case 'JoinWorld':
      return wire.JoinWorld.createJoinWorld(b, m.seq, b.createString(m.name),
                                            roles.indexOf(m.role));
    case 'LeaveWorld': return wire.LeaveWorld.createLeaveWorld(b, m.seq, m.world);
    case 'Spawn': {
      const items = m.items.map((item) => {
        wire.SpawnItem.startSpawnItem(b);
        wire.SpawnItem.addAvatar(b, item.avatar);
        const [x, y, z] = item.positionM;
        wire.SpawnItem.addPositionM(b, wire.Vec3.createVec3(b, x, y, z));
        wire.SpawnItem.addHeadingRad(b, item.headingRad);
        return wire.SpawnItem.endSpawnItem(b);
      });
      return wire.Spawn.createSpawn(b, m.seq, m.world, wire.Spawn.createItemsVector(b, items));
    }
    case 'Remove':
      return wire.Remove.createRemove(b, m.seq, m.world,
                                      wire.Remove.createAvatarsVector(b, m.avatars));
    case 'Request': {
      const items = m.items.map((item) => {
        wire.RequestItem.startRequestItem(b);
        wire.RequestItem.addAvatar(b, item.avatar);
        wire.RequestItem.addRequestId(b, item.requestId);
        wire.RequestItem.addType(b, movementTypes.indexOf(item.type));
        wire.RequestItem.addFoot(b, footChoices.indexOf(item.foot));
        wire.RequestItem.addLengthM(b, item.lengthM);
        if (item.sideM !== null) {
          b.forceDefaults(true);  // 0 is not the same as absent.
          wire.RequestItem.addSideM(b, item.sideM);
          b.forceDefaults(false);
        }
        wire.RequestItem.addHeightM(b, item.heightM);
        wire.RequestItem.addTurnRad(b, item.turnRad);
        wire.RequestItem.addSeconds(b, item.seconds);
        return wire.RequestItem.endRequestItem(b);
      });
      return wire.Request.createRequest(b, m.seq, m.world,
                                        wire.Request.createItemsVector(b, items));
    }
    case 'CancelQueue':
      return wire.CancelQueue.createCancelQueue(
          b, m.seq, m.world, wire.CancelQueue.createAvatarsVector(b, m.avatars));
    case 'Observe': {
      const avatars = wire.Observe.createAvatarsVector(b, m.avatars);
      return wire.Observe.createObserve(b, m.seq, m.world, m.subscription,
                                        poseModes.indexOf(m.mode), avatars, m.everyNTicks,
                                        m.withEvents);
    }
    case 'StopObserving':
      return wire.StopObserving.createStopObserving(b, m.seq, m.subscription);
    case 'Ping': return wire.Ping.createPing(b, m.nonce, m.timeS);
    case 'InspectAvatar':
      return wire.InspectAvatar.createInspectAvatar(b, m.nonce, m.world, m.avatar);
    case 'Goodbye': return wire.Goodbye.createGoodbye(b, m.code, b.createString(m.text));
  }
}
