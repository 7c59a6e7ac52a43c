import assert from 'node:assert/strict';
import {test} from 'node:test';

import {meanSince, parseMetrics} from '../src/prometheus.js';

test('parses Prometheus text, sums labels and skips histogram buckets', () => {
  const metrics = parseMetrics([
    '# HELP x y', 'a_total 5', 'b{shard="0"} 1.5', 'b{shard="1"} 2.5', 't_bucket{le="1"} 7',
    't_sum 0.5', 't_count 10', 'bad NaNs', ''].join('\n'));
  assert.equal(metrics.get('a_total'), 5);
  assert.equal(metrics.get('b'), 4);
  assert.equal(metrics.has('t_bucket'), false);
  assert.equal(metrics.has('bad'), false);
  const before = new Map([['t_sum', 0.3], ['t_count', 8]]);
  assert.equal(meanSince(metrics, before, 't')!.toFixed(6), '0.100000');
  assert.equal(meanSince(metrics, metrics, 't'), null);
});
