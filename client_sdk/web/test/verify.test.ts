import assert from 'node:assert/strict';
import {test} from 'node:test';
import {Builder} from 'flatbuffers';
import * as wire from '../generated/wire';
import type {MessageName} from '../generated/messages';
import {decodeMessage, type Sender} from '../src/testing';
import {makeFrame} from './support/frame';
import {readVectors} from './support/vectors';

test('rejects truncated messages', () => {
  for (const {name, frame} of readVectors()) {
    if (frame.byteLength > 4096) continue;
    // Each of these lengths cuts off more than padding.
    for (const bytes of [8, ((frame.byteLength - 16) >> 4) << 3]) {
      if (bytes >= frame.byteLength - 16) continue;
      const cut = frame.slice(0, 16 + bytes);
      new DataView(cut).setUint32(8, bytes, true);
      assert.throws(() => decodeMessage(cut), Error, `${name}, ${bytes}`);
    }
  }
});

function assertRejected(frame: ArrayBuffer, sender: Sender, why: RegExp): void {
  assert.throws(() => decodeMessage(frame, sender), why);
}

function withHeader(change: (view: DataView) => void): ArrayBuffer {
  const frame = readVectors().find(({name}) => name === 'pong')!.frame;
  change(new DataView(frame));
  return frame;
}

test('checks headers in the order of the standard', () => {
  const spoilAfter = [
    (view: DataView) => view.setUint32(0, 0), (view: DataView) => view.setUint16(4, 2, true),
    (view: DataView) => view.setUint16(6, 999, true),
    (view: DataView) => view.setUint16(6, 1, true),
    (view: DataView) => view.setUint32(12, 1, true),
    (view: DataView) => view.setUint32(8, (1 << 20) + 8, true),
    (view: DataView) => view.setUint32(8, 12, true), (view: DataView) => view.setUint32(8, 8, true),
  ];
  const why = [
    /magic/, /frame version.*2/, /message type.*999/, /this side/, /flags/, /exceeds the limit/,
    /multiple of 8/, /differs from its header/
  ];
  why.forEach((sentence, i) => {
    // Later checks would fail as well, but the first failure is reported.
    assertRejected(withHeader((view) => {
      for (let k = spoilAfter.length - 1; k >= i; --k) spoilAfter[k]!(view);
    }), 'server', sentence);
  });
  assertRejected(new ArrayBuffer(0), 'server', /shorter/);
  assertRejected(new ArrayBuffer(15), 'server', /shorter/);
});

function message(name: MessageName, build: (b: Builder) => number): ArrayBuffer {
  const b = new Builder(1024);
  b.finish(build(b));
  return makeFrame(name, b.asUint8Array());
}

test('rejects lists and texts that are too long before copying them', () => {
  assertRejected(message('Goodbye', (b) => wire.Goodbye.createGoodbye(
      b, 0, b.createString('x'.repeat(1025)))), 'server', /Goodbye.text.*1025/);
  // 65,537 references to one event make a small frame.
  assertRejected(message('Events', (b) => {
    wire.Event.startEvent(b);
    wire.Event.addAvatar(b, 1);
    const event = wire.Event.endEvent(b);
    const list = wire.Events.createEventsVector(b, new Array(65_537).fill(event));
    return wire.Events.createEvents(b, 1, 1n, 1n, list);
  }), 'server', /Events.events.*65537/);
  assertRejected(message('Reply', (b) => {
    wire.ReplyItem.startReplyItem(b);
    const item = wire.ReplyItem.endReplyItem(b);
    const list = wire.Reply.createItemsVector(b, new Array(70_000).fill(item));
    return wire.Reply.createReply(b, 1n, 0, b.createString(''), 0, list);
  }), 'server', /FlatBuffers/);
});

test('accepts texts only as UTF-8 without control characters', () => {
  const goodbye = (bytes: number[]): ArrayBuffer =>
      message('Goodbye', (b) => wire.Goodbye.createGoodbye(
          b, 0, b.createString(Uint8Array.from(bytes))));
  for (const bytes of [
    [0xc0, 0x80], [0xed, 0xa0, 0x80], [0xf4, 0x90, 0x80, 0x80], [0xe2, 0x82], [0x80], [0xff]
  ]) {
    assertRejected(goodbye(bytes), 'server', /UTF-8/);
  }
  for (const bytes of [[10], [0x7f], [0xc2, 0x85], [0]]) {
    assertRejected(goodbye(bytes), 'server', /control/);
  }
  const marked = decodeMessage(goodbye([0xef, 0xbb, 0xbf, 0x61]), 'server');
  assert.ok(marked.type === 'Goodbye' && marked.text === '\ufeffa');
});
