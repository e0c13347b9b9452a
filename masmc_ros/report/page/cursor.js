'use strict';
// One cursor over all plots over time: a line at the same time in each, and the values there.
const cursor = (() => {
  const MOST = 8; // Values in a text; of more lines the first ones are listed.
  const plain = (name) => name.replace(/<[^>]*>/g, '');
  const digits = (value) => value.toPrecision(3).replace('-', '−');

  // The values of the lines of a plot at a time: those of the last sample until then.
  const text = ({ samples, names, unit }, time) => {
    const values = samples.slice(0, MOST).map(({ x, low, high }, line) => {
      const i = lines.before(x, time + 1e-9) - 1;
      if (i < 0 || i >= low.length || Number.isNaN(low[i])) return '';
      const range = low === high ? digits(low[i]) : `${digits(low[i])} to ${digits(high[i])}`;
      return `${plain(names[line])} ${range}`;
    });
    const more = samples.length > MOST ? `, and ${samples.length - MOST} more` : '';
    const listed = values.filter((value) => value).join(', ');
    return `t = ${time.toFixed(3)} s: ${listed}${more}${unit && listed ? ` (${unit})` : ''}`;
  };

  const parts = new Map();
  const show = (time) => {
    replay.show(time);
    for (const [chart, { line, values, contentOf }] of parts) {
      const { xaxis, yaxis } = chart._fullLayout;
      const isSeen = time >= xaxis.range[0] && time <= xaxis.range[1];
      line.hidden = !isSeen;
      values.textContent = isSeen ? text(contentOf(chart), time) : '';
      line.style.left = `${xaxis._offset + xaxis.d2p(time)}px`;
      line.style.top = `${yaxis._offset}px`;
      line.style.height = `${yaxis._length}px`;
    }
  };
  let frame = 0;
  // `contentOf` returns samples, names and unit of a chart.
  const attach = (chart, contentOf) => {
    const line = document.createElement('div');
    const values = document.createElement('p');
    line.className = 'cursor';
    values.className = 'note values';
    line.hidden = true;
    chart.append(line);
    chart.after(values);
    parts.set(chart, { line, values, contentOf });
    chart.addEventListener('pointermove', (event) => {
      const { xaxis } = chart._fullLayout;
      const time = xaxis.p2d(event.clientX - chart.getBoundingClientRect().left - xaxis._offset);
      cancelAnimationFrame(frame);
      frame = requestAnimationFrame(() => show(time));
    });
  };

  return { attach, show };
})();
