// Copyright 2026 The masmc_ros authors
// SPDX-License-Identifier: Apache-2.0

// Runs of compiled laws and of the plant, in browsers and Node. The names of settings are those of
// `masmc simulate --set`; values are numbers or arrays of numbers.
class Engine {
  // description, code: texts of the page, compressed by gzip and in base64.
  static async load(description, code) {
    const unpacked = (text) => new Response(
      new Blob([Engine.bytes(text)]).stream().pipeThrough(new DecompressionStream('gzip')));
    const described = JSON.parse(await unpacked(description).text());
    const { stack: start } = described.plant;
    const memory = new WebAssembly.Memory({ initial: Math.ceil(start / 65536) });
    const stack = new WebAssembly.Global({ value: 'i32', mutable: true }, start);
    const { instance } = await WebAssembly.instantiate(
      await unpacked(code).arrayBuffer(),
      { env: { __linear_memory: memory, __stack_pointer: stack } });
    return new Engine(described, instance.exports, memory);
  }

  static bytes(text) { return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)); }

  constructor(described, functions, memory) {
    this.described = described;
    this.functions = functions;
    this.memory = memory;
    const { plant, laws } = described;
    this.records = { plant_settings: plant.plant_settings, plant_memory: plant.plant_memory, signals: plant.signals };
    for (const kind of [...Object.values(laws), this.records]) {
      for (const record of Object.values(kind)) {
        if (record.fields) record.initial = Engine.bytes(record.bytes);
      }
    }
    this.row = plant.signals.initial.length;
  }

  // The chosen value of a setting, an entry of `choices`; undefined if it is that of the file.
  chosen(setting, name) {
    const choices = this.described.choices[name] ?? [];
    const choice = choices.find(({ value }) => value === setting[name]);
    if (name in setting && !choice) throw new RangeError(`${name} = ${setting[name]}: expected ${choices.map(({ value }) => value).join(', ')}`);
    return choice;
  }

  // Number of ticks, and period in s, of a run with a setting.
  grid(setting) { return this.chosen(setting, 'control_period') ?? this.described.plant; }

  // Compute a run. Returns its ticks, its period in s, and the time at which it diverges, or null.
  run(law, setting) {
    const { laws, plant, choices } = this.described, { functions } = this;
    const { ticks, period, delay_line: delayLine } = this.grid(setting);
    this.place(laws[law], ticks, delayLine);
    for (const name of Object.keys(choices)) {
      for (const [record, fields] of Object.entries(this.chosen(setting, name)?.changes ?? {})) {
        for (const [field, values] of Object.entries(fields)) this.write(record, field, values);
      }
    }
    for (const [name, value] of Object.entries(setting)) {
      const [node, parameter] = Engine.split(name);
      const slider = node === 'controller' ? laws[law].parameters[parameter] : plant.sliders[parameter];
      if (slider) this.write(node === 'controller' ? 'settings' : 'plant_settings', slider.field, value);
      if (name === 'controller.model_scale') {
        const nominal = plant.theta.map((parameter) => value * parameter);
        this.write('settings', 'model_scale', value);
        this.write('settings', 'nominal', nominal);
        this.write('memory', 'estimate', nominal);
      }
    }
    const { at } = this, tick = functions[laws[law].tick];
    const { plant_start: start, plant_tick: move, sample_line_sine: sample } = functions;
    const position = at.signals + plant.signals.fields.position[0];
    const velocity = at.signals + plant.signals.fields.velocity[0];
    let finite = start(at.plant_settings, at.plant_memory, at.delay_line, at.signals);
    this.ticks = ticks;
    for (let k = 0; k < ticks; k++) {
      sample(at.path, period, BigInt(k), at.reference);
      const status = tick(at.settings, at.memory, at.signals, position, velocity, at.reference);
      const row = at.history + this.row * k;
      this.all.copyWithin(row, at.signals, at.signals + this.row);
      if (!finite || status & 2n) {
        this.ticks = k;
        return { ticks: k, period, diverged: k * period };
      }
      if (k < ticks - 1) finite = move(at.plant_settings, at.plant_memory, at.delay_line, BigInt(k), at.signals);
    }
    return { ticks, period, diverged: null };
  }

  static split(name) {
    const dot = name.indexOf('.');
    return dot < 0 ? ['', name] : [name.slice(0, dot), name.slice(dot + 1)];
  }

  // Put initial records and arrays of a run into the memory.
  place(law, ticks, delayLine) {
    this.records = { ...this.records, settings: law.settings, memory: law.memory };
    const { plant } = this.described, width = 3 * plant.axes.length, at = {};
    const sizes = { delay_line: 8 * delayLine, path: 40 * plant.axes.length, reference: 8 * width, history: this.row * ticks };
    for (const [name, record] of Object.entries(this.records)) sizes[name] = record.initial.length;
    let free = plant.stack;  // above constants and stack
    for (const [name, size] of Object.entries(sizes)) {
      at[name] = free;
      free = (free + size + 63) & ~63;
    }
    const missing = free - this.memory.buffer.byteLength;
    if (missing > 0) this.memory.grow(Math.ceil(missing / 65536));
    this.at = at;
    this.all = new Uint8Array(this.memory.buffer);
    this.numbers = new Float64Array(this.memory.buffer);
    this.view = new DataView(this.memory.buffer);
    for (const [name, record] of Object.entries(this.records)) this.all.set(record.initial, at[name]);
    this.all.fill(0, at.delay_line, at.delay_line + sizes.delay_line);
    this.numbers.set(plant.path.flat(), at.path / 8);
  }

  write(record, field, values) {
    const [place, count, kind] = this.records[record].fields[field];
    for (let i = 0; i < count; i++) {
      const value = Array.isArray(values) ? values[i] : values, address = this.at[record] + place + 8 * i;
      if (kind === 'i8') this.view.setBigInt64(address, BigInt(value), true);
      else this.view.setFloat64(address, value, true);
    }
  }

  read(record, field) {
    const [place, count] = this.records[record].fields[field], first = (this.at[record] + place) / 8;
    return Array.from(this.numbers.subarray(first, first + count));
  }

  // Function of tick and component that returns a number of the last run.
  signal(name) {
    const first = (this.at.history + this.described.plant.signals.fields[name][0]) / 8, step = this.row / 8, { numbers } = this;
    return (tick, i) => numbers[first + step * tick + i];
  }

  // Bytes of all signals of the last run; their digest is that of `masmc simulate --json`.
  history() { return this.all.subarray(this.at.history, this.at.history + this.row * this.ticks); }
}
