// Copyright 2026 The masmc_ros authors
// SPDX-License-Identifier: Apache-2.0

// The page around the engine: settings, drawings, comparison and links.
const at = (id) => document.getElementById(id);
const COLOURS = ['--blue', '--vermillion', '--green', '--purple', '--orange', '--sky', '--faint'];
const BUCKETS = 700, PLAY_SPEED = 4, SETTLED = 20, MOST_NAMES = 12;
let engine, law, setting = {}, run, kept = null, last = { key: '', digest: '' }, playing = null, due = false;

// Settings.

const double = (value) => {
  const text = String(value);
  if (/^-?\d+$/.test(text)) return `${text}.0`;
  return /e/.test(text) && !/\./.test(text) ? text.replace('e', '.0e') : text;
};
const text = (value) => (Array.isArray(value) ? `[${value.map(double).join(', ')}]` : double(value));
const rounded = (value) => Number(value.toPrecision(6));
const level = (value) => (Array.isArray(value) ? Math.max(...value) : value);
const brief = (value) => String(Number(level(value).toPrecision(5)));

function scaled(value, wanted) {
  if (!Array.isArray(value) || value.every((entry) => entry === value[0])) return rounded(wanted);
  return value.map((entry) => rounded(wanted * entry / level(value)));
}

// The sliders of the current law: setting, description, value of the file.
function sliders() {
  const { laws, plant, choices } = engine.described, found = [];
  const controller = Object.entries(laws[law].parameters);
  for (const [name, slider] of controller) if (!slider.is_further) found.push([`controller.${name}`, slider]);
  if (plant.sliders.model_scale) found.push(['controller.model_scale', plant.sliders.model_scale]);
  for (const name of Object.keys(choices)) found.push([name, null]);
  if (plant.sliders['disturbance.amplitude']) found.push(['plant.disturbance.amplitude', plant.sliders['disturbance.amplitude']]);
  for (const [name, slider] of controller) if (slider.is_further) found.push([`controller.${name}`, slider]);
  return found;
}

const LABELS = {
  'controller.k_s1': 'K_s1', 'controller.k_s2': 'K_s2', 'controller.sigma': 'σ', 'controller.gamma': 'Γ',
  'controller.boundary_layer': 'δ, boundary layer', 'controller.model_scale': 'assumed part of the masses',
  control_period: 'T, control period', 'plant.payload.mass': 'payload', 'plant.velocity_noise': 'noise of the velocities',
  'plant.disturbance.amplitude': 'disturbance',
};
const UNITS = { control_period: 's', 'plant.payload.mass': 'kg', 'plant.velocity_noise': 'rad/s' };
const unknown = (name) => name.replace('controller.', '').replaceAll('_', ' ');

function addField(parent, name, control, shown, title = '') {
  const field = document.createElement('div'), label = document.createElement('label'), output = document.createElement('output');
  field.className = 'field';
  control.id = `set-${name.replaceAll('.', '-')}`;
  label.htmlFor = control.id;
  label.textContent = LABELS[name] ?? unknown(name);
  label.title = title;
  output.htmlFor = control.id;
  output.textContent = shown;
  field.append(label, output, control);
  parent.append(field);
  return output;
}

function range(lowest, highest, step, value) {
  const control = document.createElement('input');
  Object.assign(control, { type: 'range', min: lowest, max: highest, step, value });
  return control;
}

function addSlider(parent, name, slider) {
  const value = setting[name] ?? slider.value;
  const control = range(slider.lowest, Math.max(slider.highest, level(value)), slider.step, level(value));
  const shown = () => `${brief(setting[name] ?? slider.value)} ${slider.unit}`;
  const output = addField(parent, name, control, shown(), slider.description);
  control.addEventListener('input', () => {
    change(name, scaled(slider.value, Number(control.value)), slider.value);
    output.textContent = shown();
    control.setAttribute('aria-valuetext', output.textContent);
  });
}

function addChoice(parent, name) {
  const choices = engine.described.choices[name], own = fileValue(name);
  const place = choices.findIndex(({ value }) => value === (setting[name] ?? own));
  if (name === 'control_period') {
    const control = range(0, choices.length - 1, 1, place), shown = () => `${brief(1000 * choices[control.value].value)} ms`;
    const output = addField(parent, name, control, shown(), 'Time between two ticks of the controller');
    control.addEventListener('input', () => {
      change(name, choices[control.value].value, own);
      output.textContent = shown();
      control.setAttribute('aria-valuetext', output.textContent);
    });
    return;
  }
  const control = document.createElement('select');
  choices.forEach(({ value }, i) => control.add(new Option(`${brief(value)} ${UNITS[name]}`, i, false, i === place)));
  addField(parent, name, control, '');
  control.addEventListener('change', () => change(name, choices[control.value].value, own));
}

// The value of the file: the choice that changes no record.
const fileValue = (name) => engine.described.choices[name].find(({ changes }) => Object.values(changes).every((fields) => !Object.keys(fields).length)).value;

function change(name, value, own) {
  if (JSON.stringify(value) === JSON.stringify(Array.isArray(own) && !Array.isArray(value) ? scaled(own, level(own)) : own)) delete setting[name];
  else setting[name] = value;
  update();
}

function showSettings() {
  const { laws } = engine.described, chosen = laws[law];
  const names = [...new Set(Object.values(laws).map((entry) => entry.law))];
  at('law').replaceChildren(...names.map((name) => new Option(name, name, false, name === chosen.law)));
  const terms = Object.values(laws).filter((entry) => entry.law === chosen.law).map((entry) => entry.switching);
  at('switching').replaceChildren(...terms.map((name) => new Option(name || 'without', name, false, name === chosen.switching)));
  at('switching').disabled = terms.length < 2;
  at('sliders').replaceChildren();
  at('further').replaceChildren();
  for (const [name, slider] of sliders()) {
    if (slider) addSlider(slider.is_further ? at('further') : at('sliders'), name, slider);
    else addChoice(at('sliders'), name);
  }
}

// Settings that the current law has.
const used = () => Object.fromEntries(sliders().filter(([name]) => name in setting).map(([name]) => [name, setting[name]]));

function choose(name, switching) {
  const { laws } = engine.described;
  const candidates = Object.entries(laws).filter(([, entry]) => entry.law === name);
  [law] = candidates.find(([, entry]) => entry.switching === switching) ?? candidates[0];
  showSettings();
  update();
}

// Texts for other programs.

function changes() {
  const { laws, own } = engine.described, chosen = laws[law], found = [];
  if (law !== own) {
    found.push(['controller.law', chosen.law]);
    if (chosen.switching) found.push(['controller.switching', chosen.switching]);
  }
  return [...found, ...Object.entries(used()).map(([name, value]) => [name, text(value)])];
}

const quoted = (word) => (/^[\w.,:/=+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);

function command() {
  const { file, settings } = engine.described;
  const words = [...settings, ...changes().map(([name, value]) => `${name}=${value}`)];
  return [`masmc simulate ${quoted(file)}`, ...words.map((word) => `--set ${quoted(word)}`)].join(' ');
}

function yaml() {
  const nodes = {};
  for (const [name, value] of changes()) {
    const [node, parameter] = Engine.split(name);
    (nodes[node ? `/**/${node}` : '/**'] ??= []).push(`    ${parameter}: ${value}\n`);
  }
  const head = `# Changes of ${engine.described.file}; a second --params-file for the nodes.\n`;
  return head + Object.entries(nodes).map(([node, lines]) => `${node}:\n  ros__parameters:\n${lines.join('')}`).join('');
}

const fragment = (chosen, values, prefix = '') => [[`${prefix}law`, chosen], ...Object.entries(values).map(([name, value]) => [prefix + name, [value].flat().join(',')])];

function link() {
  const pairs = [...fragment(law, used()), ...(kept ? fragment(kept.law, kept.setting, 'vs.') : [])];
  return `#${new URLSearchParams(pairs)}`;
}

function readLink() {
  const read = { '': {}, 'vs.': {} }, laws = {};
  for (const [key, value] of new URLSearchParams(location.hash.slice(1))) {
    const prefix = key.startsWith('vs.') ? 'vs.' : '', name = key.slice(prefix.length);
    const numbers = value.split(',').map(Number);
    if (name === 'law') laws[prefix] = value;
    else if (numbers.every(Number.isFinite)) read[prefix][name] = numbers.length > 1 ? numbers : numbers[0];
  }
  const { described } = engine, names = Object.keys(described.laws);
  // A law without a switching term is that with the first one of the page.
  const known = (name) => names.find((key) => key === name) ?? names.find((key) => key.split(':')[0] === name);
  law = known(laws['']) ?? known(described.own) ?? names[0];
  // Values that the page does not offer are dropped.
  const clean = (values) => Object.fromEntries(Object.entries(values).filter(([name, value]) => !(name in described.choices) || described.choices[name].some((choice) => choice.value === value)));
  kept = null;
  if (known(laws['vs.'])) kept = compute(known(laws['vs.']), clean(read['vs.']));
  setting = clean(read['']);
}

// Runs.

const label = (name, values) => [name.replace(':', ', '), ...Object.entries(values).map(([key, value]) => `${LABELS[key] ?? unknown(key)} ${brief(value)}`)].join('; ');

function compute(name, values) {
  const started = performance.now(), { ticks, period, diverged } = engine.run(name, values), { plant } = engine.described;
  const result = { law: name, setting: { ...values }, ticks, period, diverged, end: (engine.grid(values).ticks - 1) * period };
  const error = engine.signal('error'), torque = engine.signal('torque'), surface = engine.signal('surface');
  const estimate = engine.signal('estimate'), position = engine.signal('true_position'), reference = engine.signal('reference');
  const truth = engine.read('plant_settings', 'theta'), width = Math.max(1, Math.ceil(ticks / BUCKETS));
  const distance = ({ first, size }) => (k) => {
    let sum = 0;
    for (let i = first; i < first + size; i++) sum += error(k, i) ** 2;
    return sum;
  };
  const lines = (value, count, scale = () => 1) => Array.from({ length: count }, (_, i) => extremes((k) => value(k, i) * scale(i), ticks, width));
  result.width = width;
  result.series = {
    error: plant.points.map((point) => extremes(distance(point), ticks, width).map((square) => 1000 * Math.sqrt(square))),
    torque: lines(torque, plant.joints.length),
    surface: lines(surface, plant.axes.length),
    estimate: lines(estimate, truth.length, (i) => 1 / truth[i]).map((line, i) => (truth[i] === 0 ? null : line)),
  };
  result.stride = Math.max(1, Math.round(0.01 / period));
  result.poses = [];
  result.path = [];
  for (let k = 0; k < ticks; k += result.stride) {
    result.poses.push(Array.from({ length: plant.signals.fields.true_position[1] }, (_, i) => position(k, i)));
    result.path.push(plant.axes.map((_, i) => reference(k, i)));
  }
  if (plant.links) result.links = result.poses.map(linkPlaces);
  else [result.wheel, result.track, result.base, result.upper, result.lower] = engine.read('plant_settings', 'geometry');
  result.metrics = metrics(result, plant.points.map(distance), torque, plant.joints.length);
  result.took = performance.now() - started;
  return result;
}

// Smallest and largest value of every `width` ticks, one after the other.
function extremes(value, ticks, width) {
  const found = new Float64Array(2 * Math.ceil(ticks / width));
  for (let b = 0, k = 0; k < ticks; b += 2) {
    let low = value(k), high = low;
    for (const end = Math.min(ticks, k + width); k < end; k++) {
      const v = value(k);
      if (v < low) low = v;
      if (v > high) high = v;
    }
    found[b] = low;
    found[b + 1] = high;
  }
  return found;
}

// Metrics of the second half, as `masmc simulate` computes them, in the same order.
function metrics({ ticks, period, end, diverged }, squares, torque, joints) {
  const { points } = engine.described.plant, found = {};
  if (diverged !== null) return found;
  const window = [];
  for (let k = 0; k < ticks; k++) if (end / 2 <= k * period && k * period < end) window.push(k);
  points.forEach(({ symbol, unit }, i) => {
    let sum = 0, largest = 0;
    for (const k of window) {
      const square = squares[i](k);
      sum += square;
      largest = Math.max(largest, square);
    }
    found[`${symbol} RMS (m${unit})`] = 1000 * Math.sqrt(sum / window.length);
    found[`${symbol} max (m${unit})`] = 1000 * Math.sqrt(largest);
  });
  let effort = 0, variation = 0;
  for (const k of window) {
    let square = 0, moved = 0;
    for (let i = 0; i < joints; i++) {
      square += torque(k, i) ** 2;
      if (k > window[0]) moved += Math.abs(torque(k, i) - torque(k - 1, i));
    }
    effort += square;
    variation += moved;
  }
  found['torque RMS (N·m)'] = Math.sqrt(effort / window.length);
  found['torque variation (N·m/s)'] = variation / (end - end / 2);
  return found;
}

const hex = (buffer) => Array.from(new Uint8Array(buffer), (byte) => byte.toString(16).padStart(2, '0')).join('');

async function showDigest(shown) {
  const key = `${shown.law} ${JSON.stringify(shown.setting)}`;
  let digest = 'not computed: the page is not from a file, https or localhost';
  if (shown.diverged !== null) digest = 'none: the run diverges';
  else if (crypto.subtle) digest = hex(await crypto.subtle.digest('SHA-256', engine.history()));
  if (shown !== run) return;
  at('digest').textContent = digest;
  if (shown.diverged === null && digest === last.digest && key !== last.key) at('state').append(' The signals are those before the change.');
  last = { key, digest };
  document.documentElement.dataset.digest = digest;
}

function update() {
  if (due) return;
  due = true;
  requestAnimationFrame(refresh);
}

function refresh() {
  const { dataset } = document.documentElement;
  due = false;
  run = compute(law, used());
  dataset.digest = '';
  showResults();
  legends();
  draw();
  at('command').textContent = command();
  history.replaceState(null, '', link());
  dataset.drawn ??= Math.round(performance.now());
  clearTimeout(update.timer);
  update.timer = setTimeout(showDigest, 60, run);
}

const number = (value) => (value === undefined ? '–' : value.toPrecision(5));

function showResults() {
  const cell = (tag, content) => Object.assign(document.createElement(tag), { textContent: content });
  const row = (cells) => { const line = document.createElement('tr'); line.append(...cells); return line; };
  const body = document.createElement('tbody'), names = Object.keys(run.diverged === null ? run.metrics : kept?.metrics ?? {});
  const heads = [cell('th', 'second half'), cell('th', 'this run'), ...(kept ? [cell('th', 'compared')] : [])];
  for (const head of heads) head.scope = 'col';
  const top = document.createElement('thead');
  top.append(row(heads));
  for (const name of names) {
    const head = cell('th', name);
    head.scope = 'row';
    body.append(row([head, cell('td', number(run.metrics[name])), ...(kept ? [cell('td', number(kept.metrics[name]))] : [])]));
  }
  at('results').replaceChildren(top, body);
  const state = at('state');
  state.textContent = `${run.ticks} ticks of ${brief(1000 * run.period)} ms in ${run.took.toFixed(0)} ms.`;
  if (run.diverged !== null) {
    state.append(Object.assign(document.createElement('span'), { className: 'bad', textContent: ` The run diverges at t = ${Number(run.diverged.toPrecision(6))} s.` }));
  }
  if (kept) state.append(` Compared with ${label(kept.law, kept.setting)}.`);
  at('drop').disabled = !kept;
}

// Drawings.

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function prepared(id) {
  const canvas = at(id), ratio = devicePixelRatio || 1, { clientWidth: w, clientHeight: h } = canvas;
  canvas.width = Math.round(w * ratio);
  canvas.height = Math.round(h * ratio);
  const g = canvas.getContext('2d');
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.font = '12px system-ui, sans-serif';
  return [g, w, h];
}

function steps(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => size >= raw * 0.999);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(Number((i * step).toPrecision(10)));
  return found;
}

function axes(g, box, X, Y, across, up, format = String) {
  const [left, top, right, bottom] = box;
  g.strokeStyle = colour('--grid');
  g.fillStyle = colour('--faint');
  g.lineWidth = 1;
  g.textAlign = 'center';
  g.textBaseline = 'top';
  g.beginPath();
  for (const v of across) { g.moveTo(X(v), top); g.lineTo(X(v), bottom); g.fillText(v, X(v), bottom + 4); }
  g.textAlign = 'right';
  g.textBaseline = 'middle';
  for (const v of up) { g.moveTo(left, Y(v)); g.lineTo(right, Y(v)); g.fillText(format(v), left - 5, Y(v)); }
  g.stroke();
}

const now = () => Number(at('time').value) / 1000;

function plot(id, isLog = false) {
  const [g, w, h] = prepared(id), box = [52, 6, w - 8, h - 20], [left, top, right, bottom] = box;
  const traces = kept ? [kept, run] : [run], end = Math.max(...traces.map((trace) => trace.end));
  let low = Infinity, high = -Infinity;
  for (const trace of traces) {
    for (const line of trace.series[id]) {
      if (!line) continue;
      const first = isLog || id === 'estimate' ? 0 : 2 * Math.ceil(line.length / 2 / SETTLED);
      for (let i = first; i < line.length; i++) {
        if (line[i] < low && (!isLog || line[i] > 1e-6)) low = line[i];
        if (line[i] > high) high = line[i];
      }
    }
  }
  if (!Number.isFinite(low) || !Number.isFinite(high)) [low, high] = isLog ? [1, 10] : [-1, 1];
  if (isLog) [low, high] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
  if (id === 'estimate') [low, high] = [Math.min(low, 0), Math.max(high, 1.1)];
  if (!(high > low)) [low, high] = [low - 1, high + 1];
  const gap = isLog ? 0 : 0.04 * (high - low);
  [low, high] = [low - gap, high + gap];
  const X = (t) => left + (t / end) * (right - left);
  const Y = (v) => bottom - ((v - low) / (high - low)) * (bottom - top);
  const scale = isLog ? (v) => Y(Math.log10(Math.max(v, 1e-9))) : Y;
  axes(g, box, X, Y, steps(0, end, Math.max(3, w / 90)), isLog ? steps(low, high, 5).filter(Number.isInteger) : steps(low, high, 5), isLog ? (v) => (v < -3 ? `1e${v}` : Number((10 ** v).toPrecision(3))) : (v) => (v && Math.abs(v) < 1e-3 ? v.toExponential() : v));
  g.save();
  g.beginPath();
  g.rect(left, top, right - left, bottom - top);
  g.clip();
  if (id === 'estimate') {
    g.strokeStyle = colour('--ink');
    g.setLineDash([2, 4]);
    g.beginPath();
    g.moveTo(left, Y(1));
    g.lineTo(right, Y(1));
    g.stroke();
  }
  for (const trace of traces) {
    g.setLineDash(trace === run ? [] : [5, 4]);
    g.lineWidth = trace === run ? 1.5 : 1.1;
    trace.series[id].forEach((line, c) => {
      if (!line) return;
      g.strokeStyle = colour(COLOURS[c % COLOURS.length]);
      g.beginPath();
      for (let i = 0; i < line.length; i++) g.lineTo(X((i >> 1) * trace.width * trace.period), scale(line[i]));
      g.stroke();
    });
  }
  g.restore();
  g.setLineDash([]);
  g.strokeStyle = colour('--faint');
  g.lineWidth = 1;
  g.beginPath();
  g.moveTo(X(now() * run.end), top);
  g.lineTo(X(now() * run.end), bottom);
  g.stroke();
}

function pose(trace, [x, y, yaw, , , first, second]) {
  const F = [x + trace.base * Math.cos(yaw), y + trace.base * Math.sin(yaw)];
  const elbow = [F[0] + trace.upper * Math.cos(yaw + first), F[1] + trace.upper * Math.sin(yaw + first)];
  const bend = yaw + first + second;
  return { x, y, yaw, F, elbow, E: [elbow[0] + trace.lower * Math.cos(bend), elbow[1] + trace.lower * Math.sin(bend)] };
}

function plane() {
  const [g, w, h] = prepared('plane'), box = [34, 6, w - 8, h - 20], [left, top, right, bottom] = box;
  const traces = kept ? [kept, run] : [run];
  const tips = new Map(traces.map((trace) => [trace, trace.poses.map((values) => pose(trace, values))]));
  const bounds = [Infinity, Infinity, -Infinity, -Infinity];
  const include = (x, y, around) => {
    if (!(Math.abs(x) < 1e3 && Math.abs(y) < 1e3)) return;
    bounds[0] = Math.min(bounds[0], x - around);
    bounds[1] = Math.min(bounds[1], y - around);
    bounds[2] = Math.max(bounds[2], x + around);
    bounds[3] = Math.max(bounds[3], y + around);
  };
  for (const row of run.path) for (let i = 0; i < row.length; i += 2) include(row[i], row[i + 1], 0.3);
  for (const { x, y } of tips.get(run)) include(x, y, 0.3);
  const size = Math.min((right - left) / (bounds[2] - bounds[0]), (bottom - top) / (bounds[3] - bounds[1]));
  const cx = (bounds[0] + bounds[2]) / 2, cy = (bounds[1] + bounds[3]) / 2;
  const X = (x) => (left + right) / 2 + (x - cx) * size, Y = (y) => (top + bottom) / 2 - (y - cy) * size;
  const inX = [cx - (right - left) / 2 / size, cx + (right - left) / 2 / size], inY = [cy - (bottom - top) / 2 / size, cy + (bottom - top) / 2 / size];
  axes(g, box, X, Y, steps(...inX, w / 90), steps(...inY, 5));
  g.save();
  g.beginPath();
  g.rect(left, top, right - left, bottom - top);
  g.clip();
  const line = (points, ink, width, dash = []) => {
    g.strokeStyle = ink;
    g.lineWidth = width;
    g.setLineDash(dash);
    g.beginPath();
    for (const [x, y] of points) g.lineTo(X(x), Y(y));
    g.stroke();
    g.setLineDash([]);
  };
  const faint = colour('--faint'), ink = colour('--ink');
  for (let i = 0; i < run.path[0].length; i += 2) line(run.path.map((row) => [row[i], row[i + 1]]), faint, 1.2, [2, 4]);
  for (const trace of traces) {
    const count = Math.floor(now() * (tips.get(trace).length - 1)) + 1, seen = tips.get(trace).slice(0, count);
    const dash = trace === run ? [] : [5, 4];
    line(seen.map(({ E }) => E), colour('--blue'), 1.8, dash);
    line(seen.map(({ F }) => F), colour('--vermillion'), 1.8, dash);
  }
  const { x, y, yaw, F, elbow, E } = tips.get(run)[Math.floor(now() * (run.poses.length - 1))];
  const turned = (u, v) => [x + u * Math.cos(yaw) - v * Math.sin(yaw), y + u * Math.sin(yaw) + v * Math.cos(yaw)];
  const { wheel, track } = run, body = [[-track, -track], [track, -track], [track, track], [-track, track], [-track, -track]];
  g.globalAlpha = 0.2;
  g.fillStyle = ink;
  g.beginPath();
  for (const [u, v] of body) g.lineTo(...turned(u, v).map((value, i) => [X, Y][i](value)));
  g.fill();
  g.globalAlpha = 1;
  for (const v of [-track, track]) line([turned(-wheel, v), turned(wheel, v)], ink, 5);
  line([F, elbow, E], ink, 3.5);
  for (const [place, name] of [[F, '--vermillion'], [elbow, '--ink'], [E, '--blue']]) {
    g.fillStyle = colour(name);
    g.beginPath();
    g.arc(X(place[0]), Y(place[1]), 4.5, 0, 7);
    g.fill();
  }
  g.restore();
  at('now').textContent = `${(now() * run.end).toFixed(2)} s`;
  at('time').setAttribute('aria-valuetext', at('now').textContent);
}

// Robots of links: turned by dragging, with z upwards.

const view = { azimuth: -0.9, elevation: 0.4 };
const combined = (a, b) => [
  a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
  a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]];
const turned = (q, [x, y, z]) => combined(combined(q, [x, y, z, 0]), [-q[0], -q[1], -q[2], q[3]]).slice(0, 3);
const sum = (a, b) => a.map((value, i) => value + b[i]);

// Places of all frames in the world; kinds of motion: 0 stands, 1 turns, 2 slides, 3 the base.
function linkPlaces(position) {
  const places = [], attitudes = [];
  for (const [parent, motion, place, multiplier, ...numbers] of engine.described.plant.links.frames) {
    let offset = numbers.slice(0, 3), q = numbers.slice(3, 7);
    const axis = numbers.slice(7), way = multiplier * (position[place] ?? 0);
    if (motion === 3) {
      offset = [position[0], position[1], 0];
      q = [0, 0, Math.sin(position[2] / 2), Math.cos(position[2] / 2)];
    } else if (motion === 1) q = combined(q, [...axis.map((value) => value * Math.sin(way / 2)), Math.cos(way / 2)]);
    else if (motion === 2) offset = sum(offset, turned(q, axis.map((value) => value * way)));
    places.push(parent < 0 ? offset : sum(places[parent], turned(attitudes[parent], offset)));
    attitudes.push(parent < 0 ? q : combined(attitudes[parent], q));
  }
  return places;
}

function space() {
  const [g, w, h] = prepared('plane'), traces = kept ? [kept, run] : [run], { ways } = engine.described.plant.links;
  const { azimuth, elevation } = view, [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
  const seen = ([x, y, z]) => [ca * y - sa * x, ce * z - se * (ca * x + sa * y)];
  const corners = [Infinity, Infinity, -Infinity, -Infinity], ground = [Infinity, Infinity, -Infinity, -Infinity];
  const include = (box, [u, v]) => { box[0] = Math.min(box[0], u); box[1] = Math.min(box[1], v); box[2] = Math.max(box[2], u); box[3] = Math.max(box[3], v); };
  for (const places of run.links) for (const point of places) if (point.every((value) => Math.abs(value) < 1e3)) { include(corners, seen(point)); include(ground, point); }
  const grid = [0, 1].map((i) => [Math.floor(2 * ground[i] - 0.5) / 2, Math.ceil(2 * ground[i + 2] + 0.5) / 2]);
  for (const x of grid[0]) for (const y of grid[1]) include(corners, seen([x, y, 0]));
  const size = Math.min((w - 24) / (corners[2] - corners[0]), (h - 24) / (corners[3] - corners[1]));
  const at2 = (point) => { const [u, v] = seen(point); return [w / 2 + (u - (corners[0] + corners[2]) / 2) * size, h / 2 - (v - (corners[1] + corners[3]) / 2) * size]; };
  const line = (points, ink, width, dash = []) => {
    g.strokeStyle = ink;
    g.lineWidth = width;
    g.setLineDash(dash);
    g.beginPath();
    for (const point of points) g.lineTo(...at2(point));
    g.stroke();
    g.setLineDash([]);
  };
  const lines = ([low, high]) => Array.from({ length: Math.round(2 * (high - low)) + 1 }, (_, i) => low + i / 2);
  for (const x of lines(grid[0])) line(grid[1].map((y) => [x, y, 0]), colour('--grid'), 1);
  for (const y of lines(grid[1])) line(grid[0].map((x) => [x, y, 0]), colour('--grid'), 1);
  for (const { first, size: count, is_place: isPlace } of engine.described.plant.points) {
    if (isPlace) line(run.path.map((row) => [row[first], row[first + 1], count > 2 ? row[first + 2] : 0]), colour('--faint'), 1.2, [2, 4]);
  }
  const shown = (trace) => Math.floor(now() * (trace.links.length - 1));
  for (const trace of traces) {
    ways.forEach((way, i) => line(trace.links.slice(0, shown(trace) + 1).map((places) => places[way.at(-1)]), colour(COLOURS[i % COLOURS.length]), 1.8, trace === run ? [] : [5, 4]));
  }
  const places = run.links[shown(run)];
  ways.forEach((way, i) => {
    line(way.map((frame) => places[frame]), colour('--ink'), 3.5);
    for (const frame of way) {
      g.fillStyle = colour(frame === way.at(-1) ? COLOURS[i % COLOURS.length] : '--ink');
      g.beginPath();
      g.arc(...at2(places[frame]), frame === way.at(-1) ? 4.5 : 3, 0, 7);
      g.fill();
    }
  });
  at('now').textContent = `${(now() * run.end).toFixed(2)} s`;
  at('time').setAttribute('aria-valuetext', at('now').textContent);
}

function turn(event) {
  if (!event.buttons) return;
  view.azimuth -= 0.01 * event.movementX;
  view.elevation = Math.min(1.5, Math.max(0, view.elevation + 0.01 * event.movementY));
  space();
}

function draw() {
  if (engine.described.plant.links) space();
  else plane();
  plot('error', true);
  for (const id of ['estimate', 'torque', 'surface']) plot(id);
  for (const [id, point] of [['error', 0], ['plane', 0]]) {
    const [rms] = Object.entries(run.metrics)[point] ?? ['', 0];
    at(id).setAttribute('aria-label', run.diverged === null ? `${at(`${id}-title`).textContent}: ${rms} ${number(run.metrics[rms])}` : 'The run diverges');
  }
}

function legends() {
  const { plant } = engine.described;
  const truth = engine.read('plant_settings', 'theta');
  const points = plant.points.map(({ symbol, name }) => `${symbol}: ${name}`);
  const parameters = plant.parameters.length > MOST_NAMES ? [] : plant.parameters;
  const names = { plane: plant.links ? [] : points, error: points, torque: plant.joints, surface: plant.axes, estimate: parameters };
  for (const [id, entries] of Object.entries(names)) {
    at(`${id}-legend`).replaceChildren(...entries.map((entry, i) => {
      const item = Object.assign(document.createElement('span'), { textContent: entry.replaceAll('_', ' ') });
      item.style.setProperty('--line', `var(${COLOURS[i % COLOURS.length]})`);
      return id === 'estimate' && truth[i] === 0 ? '' : item;
    }));
  }
}

function play() {
  if (playing !== null) {
    playing = null;
  } else {
    const from = now() >= 1 ? 0 : now(), started = performance.now();
    playing = (time) => {
      if (playing === null) return;
      at('time').value = 1000 * Math.min(1, from + ((time - started) / 1000) * PLAY_SPEED / run.end);
      draw();
      if (now() < 1) requestAnimationFrame(playing);
      else play();
    };
    requestAnimationFrame(playing);
  }
  at('play').textContent = playing === null ? 'play' : 'pause';
}

async function copy(button, content) {
  const before = button.textContent;
  try {
    await navigator.clipboard.writeText(content);
    button.textContent = 'copied';
  } catch {
    // Without permission, the user copies from the page.
    at('command').textContent = content;
    getSelection().selectAllChildren(at('command'));
    button.textContent = 'selected below';
  }
  setTimeout(() => { button.textContent = before; }, 1500);
}

async function start() {
  engine = await Engine.load(DESCRIPTION, CODE);
  if (engine.described.plant.links) {
    at('plane-title').textContent = 'Robot in space (squares of 0.5 m; drag to turn)';
    at('error-title').textContent = 'Distance from the reference (mm, mrad)';
    at('plane').style.touchAction = 'pan-y';
    at('plane').addEventListener('pointermove', turn);
  }
  readLink();
  showSettings();
  refresh();
  at('law').addEventListener('change', () => choose(at('law').value, engine.described.laws[law].switching));
  at('switching').addEventListener('change', () => choose(at('law').value, at('switching').value));
  at('reset').addEventListener('click', () => { setting = {}; showSettings(); update(); });
  at('keep').addEventListener('click', () => { kept = run; update(); });
  at('drop').addEventListener('click', () => { kept = null; update(); });
  at('link').addEventListener('click', () => copy(at('link'), location.href));
  at('yaml').addEventListener('click', () => copy(at('yaml'), yaml()));
  at('play').addEventListener('click', play);
  at('time').addEventListener('input', draw);
  addEventListener('resize', draw);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
  addEventListener('hashchange', () => { readLink(); showSettings(); update(); });
  addEventListener('keydown', (event) => {
    if (event.key !== ' ' || event.target.closest('button, select, summary')) return;
    event.preventDefault();
    play();
  });
}

start().catch((error) => { at('state').textContent = `The page cannot compute: ${error.message}`; at('state').className = 'bad'; });
