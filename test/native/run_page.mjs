// Copyright 2026 The masmc_ros authors
// SPDX-License-Identifier: Apache-2.0

// Computes runs of a page of `masmc page`, and prints the SHA-256 of the signals of each.
// usage: node run_page.mjs PAGE.html [LAW, {SETTING: VALUE}] ... (JSON)
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';

const [, , path, ...runs] = process.argv;
// The first script has the engine and its data, the second one the page around them.
const [, source] = readFileSync(path, 'utf-8').match(/<script>([^]*?)<\/script>/);
const engine = await new Function(`${source}; return Engine.load(DESCRIPTION, CODE);`)();
for (const run of runs) {
  const { diverged } = engine.run(...JSON.parse(run));
  console.log(diverged ?? createHash('sha256').update(engine.history()).digest('hex'));
}
