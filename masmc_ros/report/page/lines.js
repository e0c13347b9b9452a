'use strict';
// What is drawn of lines: every sample where there is room, else what no eye can tell from it.
const lines = (() => {
  // Differences of numbers, their first bytes, then their second ones and so on, compressed.
  const unpack = async (text, Numbers) => {
    const stream = new Blob([bytesOf(text)]).stream().pipeThrough(new DecompressionStream('deflate'));
    const planes = new Uint8Array(await new Response(stream).arrayBuffer());
    const size = Numbers.BYTES_PER_ELEMENT;
    const count = planes.length / size;
    const whole = new Uint8Array(planes.length);
    for (let i = 0; i < count; i += 1) {
      for (let j = 0; j < size; j += 1) whole[size * i + j] = planes[count * j + i];
    }
    const numbers = new Numbers(whole.buffer);
    for (let i = 1; i < count; i += 1) numbers[i] += numbers[i - 1];
    return numbers;
  };
  const values = async (text) => new Float32Array((await unpack(text, Int32Array)).buffer);
  const times = async (text) => (await unpack(text, Float64Array)).map((time) => time / 1e9);

  // Number of times before a time.
  const before = (x, time) => {
    let [from, to] = [0, x.length];
    while (from < to) {
      const middle = (from + to) >> 1;
      if (x[middle] < time) from = middle + 1;
      else to = middle;
    }
    return from;
  };

  // Stretches of which least and greatest are known, as boxes: what is in between is not known.
  const boxes = ({ x, low, high }, first, last) => {
    const drawn = { x: [], y: [], fill: 'toself' };
    for (let i = first; i <= last; i += 1) {
      drawn.x.push(x[i], x[i], x[i + 1], x[i + 1], x[i], null);
      drawn.y.push(low[i], high[i], high[i], low[i], low[i], null);
    }
    return drawn;
  };

  // The least and the greatest of every column of pixels, in their order; NaN is a gap.
  const columns = ({ x, low, high }, first, last, width) => {
    const drawn = { x: [], y: [], fill: 'none' };
    const scale = width / (x[last] - x[first]);
    for (let i = first; i <= last; ) {
      const column = Math.floor((x[i] - x[first]) * scale);
      let [least, greatest, gap] = [-1, -1, -1];
      for (; i <= last && Math.floor((x[i] - x[first]) * scale) === column; i += 1) {
        if (Number.isNaN(low[i])) {
          if (gap < 0) gap = i;
          continue;
        }
        if (least < 0 || low[i] < low[least]) least = i;
        if (greatest < 0 || high[i] > high[greatest]) greatest = i;
      }
      const kept = [[least, low], [greatest, high], [gap, low]].filter(([at]) => at >= 0);
      for (const [at, of] of kept.sort(([a], [b]) => a - b)) {
        drawn.x.push(x[at]);
        drawn.y.push(of[at]);
      }
    }
    return drawn;
  };

  const signal = (samples, [begin, end], width) => {
    const { x, low, high } = samples;
    // One more on either side, so that the line leaves the picture.
    const first = Math.max(0, before(x, begin) - 1);
    const last = Math.min(low.length - 1, before(x, end));
    // Ranges that are narrower than two pixels look like a line through their ends.
    const enough = low === high ? 2 * width : width / 2;
    if (last - first >= enough) return columns(samples, first, last, width);
    if (low !== high) return boxes(samples, first, last);
    return { x: x.slice(first, last + 1), y: low.slice(first, last + 1), fill: 'none' };
  };

  // A path where it is seen, of points that are more than half a pixel apart.
  const path = ({ x, y }, [left, right], [bottom, top], width) => {
    const drawn = { x: [], y: [], fill: 'none' };
    const near = (right - left) / width / 2;
    const crosses = ([a, b], low, high) => Math.min(a, b) <= high && Math.max(a, b) >= low;
    const isSeen = (i) =>
      crosses([x[i], x[i + 1]], left, right) && crosses([y[i], y[i + 1]], bottom, top);
    let latest = -1;
    let isGap = false;
    for (let i = 0; i < x.length; i += 1) {
      if (!isSeen(i - 1) && !isSeen(i)) {
        isGap = latest >= 0;
        continue;
      }
      const isNear = Math.hypot(x[i] - x[latest], y[i] - y[latest]) < near;
      if (isNear && !isGap && i + 1 < x.length) continue;
      if (isGap) {
        drawn.x.push(null);
        drawn.y.push(null);
      }
      isGap = false;
      drawn.x.push(x[i]);
      drawn.y.push(y[i]);
      latest = i;
    }
    return drawn;
  };

  // From the least to the greatest of what paths have, and some room.
  const extent = (all) => {
    let [least, greatest] = [Infinity, -Infinity];
    for (const values of all) {
      for (const value of values) {
        if (value < least) least = value;
        if (value > greatest) greatest = value;
      }
    }
    const room = 0.04 * (greatest - least) || 1;
    return [least - room, greatest + room];
  };

  // Where a line of peaks is clipped: the parts of its values below and above.
  const [LOW, HIGH] = [0.005, 0.995];
  // A range with the clipped values has to be this much larger, otherwise nothing is clipped.
  const LARGER = 1.5;
  // The range of an axis that ignores short peaks, and the largest value outside of it.
  const bounds = (drawn) => {
    const all = Float64Array.from(drawn.flatMap(({ y }) => y.length ? [...y] : []))
      .filter(Number.isFinite)
      .sort();
    if (all.length === 0) return { range: null, peak: null };
    const at = (part) => all[Math.round(part * (all.length - 1))];
    const [least, greatest] = [all[0], all[all.length - 1]];
    const [low, high] = [at(LOW), at(HIGH)];
    const room = 0.08 * (high - low) || 1;
    if (!(greatest - least > LARGER * (high - low)) || high === low) {
      const whole = 0.06 * (greatest - least) || 1;
      return { range: [least - whole, greatest + whole], peak: null };
    }
    const peak = { value: 0 };
    drawn.forEach(({ x, y }, line) => {
      for (let i = 0; i < y.length; i += 1) {
        const isOutside = y[i] < low - room || y[i] > high + room;
        if (isOutside && Math.abs(y[i]) > Math.abs(peak.value)) {
          Object.assign(peak, { value: y[i], time: x[i], line });
        }
      }
    });
    return { range: [low - room, high + room], peak: 'line' in peak ? peak : null };
  };

  const read = async (samples, isOverTime) => {
    if (!isOverTime) return { x: await values(samples.x), y: await values(samples.y) };
    const low = await values(samples.y ?? samples.low);
    return { x: await times(samples.x), low, high: samples.y ? low : await values(samples.high) };
  };

  return { read, values, before, signal, path, extent, bounds };
})();
