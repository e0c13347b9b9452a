'use strict';
// The robot at the time of the cursor, drawn over the plot of its path.
const replay = (() => {
  const robots = new Map();
  let latest = 0;

  const place = ({ chart, times, parts, numbers, svg, shapes }, time) => {
    const { xaxis, yaxis } = chart._fullLayout;
    Object.assign(svg.style, {
      left: `${xaxis._offset}px`,
      top: `${yaxis._offset}px`,
      width: `${xaxis._length}px`,
      height: `${yaxis._length}px`,
    });
    const count = times.length;
    const after = Math.min(Math.max(lines.before(times, time), 1), count - 1);
    const first = Math.max(after - 1, 0);
    const length = times[after] - times[first];
    const share = length > 0 ? Math.min(Math.max((time - times[first]) / length, 0), 1) : 0;
    const at = (row) =>
      numbers[row * count + first] * (1 - share) + numbers[row * count + after] * share;
    let row = 0;
    parts.forEach(([, size], part) => {
      const points = [];
      for (let i = 0; i < size; i += 1, row += 2) {
        points.push(`${xaxis.d2p(at(row)).toFixed(1)},${yaxis.d2p(at(row + 1)).toFixed(1)}`);
      }
      const isKnown = !points.some((point) => point.includes('NaN'));
      shapes[part].setAttribute('points', isKnown ? points.join(' ') : '');
    });
  };
  const show = (time) => {
    latest = time;
    for (const robot of robots.values()) {
      robot.slider.value = time;
      place(robot, time);
    }
  };

  // `move` sets the cursor of all plots to a time.
  const attach = async (chart, { times, parts, points }, move) => {
    const numbers = await lines.values(points);
    // That of the chart's own drawings: a page contains no addresses.
    const { namespaceURI } = chart.querySelector('svg');
    const svg = document.createElementNS(namespaceURI, 'svg');
    svg.setAttribute('class', 'robot');
    svg.setAttribute('aria-hidden', 'true');
    const shapes = parts.map(([kind]) => {
      const shape = document.createElementNS(
        namespaceURI, kind === 'links' ? 'polyline' : 'polygon',
      );
      shape.setAttribute('class', kind);
      svg.append(shape);
      return shape;
    });
    chart.append(svg);
    const [controls, button, slider] = ['p', 'button', 'input'].map((tag) =>
      document.createElement(tag));
    controls.className = 'replay';
    button.type = 'button';
    Object.assign(slider, { type: 'range', min: 0, max: times[times.length - 1], step: 'any', value: 0 });
    slider.setAttribute('aria-label', 'time of the replay in s');
    controls.append(button, slider);
    chart.after(controls);
    let frame = 0;
    const stop = () => {
      cancelAnimationFrame(frame);
      frame = 0;
      button.textContent = '▶ Replay';
    };
    const play = () => {
      const end = Number(slider.max);
      const start = performance.now() - 1000 * (latest >= end ? 0 : latest);
      const step = (now) => {
        const time = Math.max((now - start) / 1000, 0);
        move(Math.min(time, end));
        if (time < end) frame = requestAnimationFrame(step);
        else stop();
      };
      button.textContent = '❚❚ Pause';
      frame = requestAnimationFrame(step);
    };
    stop();
    button.addEventListener('click', () => (frame ? stop() : play()));
    slider.addEventListener('input', () => {
      stop();
      move(Number(slider.value));
    });
    const robot = { chart, times, parts, numbers, svg, shapes, slider };
    robots.set(chart, robot);
    chart.on('plotly_afterplot', () => place(robot, latest));
    slider.value = latest;
    place(robot, latest);
  };

  return { attach, show };
})();
