'use strict';
(() => {
  const charts = [...document.querySelectorAll('.plot')];
  const overTime = charts.filter((chart) => chart.classList.contains('over-time'));
  const colour = (name) =>
    getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

  // The traces name their colours; light and dark have a tone for each.
  const paint = (data, layout) => {
    for (const trace of data) {
      if (trace.line) trace.line.color = colour(trace.meta);
      if (trace.marker) trace.marker.color = colour(trace.meta);
    }
    layout.paper_bgcolor = layout.plot_bgcolor = 'rgba(0,0,0,0)';
    layout.modebar = { bgcolor: 'rgba(0,0,0,0)', color: colour('faint'), activecolor: colour('ink') };
    layout.font.color = colour('ink');
    layout.hoverlabel = { bgcolor: colour('paper'), font: { color: colour('ink') } };
    for (const axis of [layout.xaxis, layout.yaxis]) {
      axis.gridcolor = axis.zerolinecolor = colour('grid');
      axis.linecolor = colour('faint');
    }
  };

  // Where fingers scroll the page, the plots' buttons zoom. No button shares data with a server.
  const isTouched = matchMedia('(pointer: coarse)').matches;
  const config = {
    responsive: true,
    displaylogo: false,
    showSendToCloud: false,
    plotlyServerURL: '',
    displayModeBar: isTouched || undefined,
    doubleClick: 'reset',
    modeBarButtonsToRemove: ['select2d', 'lasso2d', 'autoScale2d'],
  };
  // The lines of a plot, and what is seen of them: within a stretch of time, or of the plane.
  const held = new Map();
  const seen = (chart, { xaxis, yaxis }) => {
    const { samples, isOverTime } = held.get(chart);
    const width = Math.max(chart.clientWidth, 100);
    if (isOverTime) return samples.map((each) => lines.signal(each, xaxis.range, width));
    const [x, y] = [xaxis.range, yaxis.range];
    // A metre is as long in x as in y: what is smaller tells what a pixel is.
    const isWide = x[1] - x[0] > y[1] - y[0];
    return samples.map((each) => lines.path(each, x, y, isWide ? width : width / 2));
  };
  const draw = async (chart) => {
    const { data, layout } = JSON.parse(document.getElementById(`${chart.id}-data`).textContent);
    const isOverTime = overTime.includes(chart);
    const drawn = data.filter((trace) => trace.meta.samples);
    const samples = drawn.map((trace) => lines.read(trace.meta.samples, isOverTime));
    held.set(chart, {
      isOverTime,
      samples: await Promise.all(samples),
      traces: drawn.map((trace) => data.indexOf(trace)),
    });
    for (const trace of data) trace.meta = trace.meta.colour;
    if (!isOverTime) {
      for (const axis of ['x', 'y']) {
        const all = held.get(chart).samples.map((each) => each[axis]);
        layout[`${axis}axis`].range = lines.extent(all);
      }
    }
    seen(chart, layout).forEach((line, i) => Object.assign(drawn[i], line));
    paint(data, layout);
    if (isTouched) layout.dragmode = false;
    return Plotly.newPlot(chart, data, layout, config);
  };
  const redraw = (chart, change) => {
    const axes = change['xaxis.range'] ? { xaxis: { range: change['xaxis.range'] } } : chart.layout;
    const found = seen(chart, axes);
    const line = Object.fromEntries(
      ['x', 'y', 'fill'].map((key) => [key, found.map((each) => each[key])]),
    );
    return Plotly.update(chart, line, change, held.get(chart).traces);
  };

  let isLinking = false;
  const link = (chart) =>
    chart.on('plotly_relayout', async (changed) => {
      if (isLinking || !Object.keys(changed).some((key) => /^[xy]axis/.test(key))) return;
      const isOverTime = overTime.includes(chart);
      if (isOverTime && !Object.keys(changed).some((key) => key.startsWith('xaxis'))) return;
      isLinking = true;
      const range = [...chart.layout.xaxis.range];
      const others = isOverTime ? overTime.filter((other) => other !== chart) : [];
      await Promise.all([
        redraw(chart, {}),
        ...others.map((other) => redraw(other, { 'xaxis.range': [...range] })),
      ]);
      isLinking = false;
    });

  Promise.all(charts.map(draw)).then(() => {
    charts.forEach(link);
    document.documentElement.dataset.drawn = charts.length;
  });
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
    for (const chart of charts) {
      paint(chart.data, chart.layout);
      Plotly.redraw(chart);
    }
  });
})();
