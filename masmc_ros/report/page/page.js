'use strict';
(() => {
  // Drawn plots, and what those have that are drawn when they come near the window: a plot takes
  // as long as everything else of the page. Those of a run among many are added when it is opened.
  const charts = [];
  const undrawn = new Map();
  const overTime = [];
  const span = [0, Number(document.querySelector('main').dataset.span)];
  let view = span; // the stretch of time of all plots
  const colour = (name) =>
    getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

  // Numbers of a trace, which plotly writes as a list or as base64 of doubles.
  const numbers = (values) =>
    values.bdata ? new Float64Array(bytesOf(values.bdata).buffer) : values;

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
  // The ordinate of what is seen; all changes of a layout that follow from a stretch of time.
  const ordinate = (chart, drawn, isWhole) => {
    const { home, hasPeaks, names, unit } = held.get(chart);
    if (!hasPeaks) return isWhole && home ? { 'yaxis.range': [...home] } : { 'yaxis.autorange': true };
    const { range, peak } = lines.bounds(drawn);
    const text = peak
      ? `peak ${peak.value.toPrecision(3).replace('-', '−')} ${unit} at ${peak.time.toFixed(3)} s, ${names[peak.line]}`
      : '';
    const place = { xref: 'paper', yref: 'paper', x: 0, y: 1, xanchor: 'left', yanchor: 'bottom' };
    return {
      ...(range ? { 'yaxis.range': range } : { 'yaxis.autorange': true }),
      annotations: text ? [{ ...place, text, showarrow: false, font: { size: 12 } }] : [],
    };
  };
  const isWhole = (chart, [begin, end]) => {
    const [first, last] = held.get(chart).span;
    return begin <= first && end >= last;
  };

  // Names of events where they neither overlap nor leave the plot; the tooltips have all.
  const SYMBOL = 16; // pixels of a triangle and its margin
  const measure = document.createElement('canvas').getContext('2d');
  const name = (chart, { data, layout }, [begin, end]) => {
    const marks = data.find((trace) => trace.mode === 'markers+text');
    if (!marks) return;
    const { names, times } = held.get(chart).marks;
    const { l, r } = layout.margin;
    const width = Math.max(chart.clientWidth, 100) - l - r;
    measure.font = `${layout.font.size}px sans-serif`;
    const places = times.map((time) => ((time - begin) / (end - begin)) * width);
    let free = 0;
    marks.text = [];
    marks.textposition = [];
    places.forEach((x, i) => {
      const size = measure.measureText(names[i].replace(/&[a-z#0-9]+;/g, '_')).width + SYMBOL;
      const isSeen = x >= 0 && x <= width;
      const isOnRight = isSeen && x + size <= Math.min(width, places[i + 1] ?? width);
      const isOnLeft = isSeen && !isOnRight && x - size >= free;
      marks.text.push(isOnRight || isOnLeft ? names[i] : '');
      marks.textposition.push(isOnLeft ? 'bottom left' : 'bottom right');
      if (isSeen) free = isOnRight ? x + size : x + SYMBOL;
    });
  };

  const prepare = async (chart) => {
    const { data, layout } = JSON.parse(document.getElementById(`${chart.id}-data`).textContent);
    const isOverTime = chart.classList.contains('over-time');
    const drawn = data.filter((trace) => trace.meta.samples);
    const samples = drawn.map((trace) => lines.read(trace.meta.samples, isOverTime));
    const marks = data.find((trace) => trace.mode === 'markers+text');
    held.set(chart, {
      isOverTime,
      samples: await Promise.all(samples),
      traces: drawn.map((trace) => data.indexOf(trace)),
      names: drawn.map((trace) => trace.name),
      span,
      home: layout.yaxis.range,
      hasPeaks: layout.meta?.hasPeaks,
      unit: layout.yaxis.title.text.match(/\(([^()]*)\)$/)?.[1] ?? '',
      marks: marks && { names: marks.text, times: [...numbers(marks.x)] },
    });
    for (const trace of data) trace.meta = trace.meta.colour;
    if (!isOverTime) {
      for (const axis of ['x', 'y']) {
        const all = held.get(chart).samples.map((each) => each[axis]);
        layout[`${axis}axis`].range = lines.extent(all);
      }
    }
    undrawn.set(chart, { data, layout });
  };
  // Without a wait: also before the page is printed.
  const draw = (chart) => {
    const { data, layout } = undrawn.get(chart);
    const { isOverTime, traces } = held.get(chart);
    undrawn.delete(chart);
    if (isOverTime) layout.xaxis.range = [...view];
    const found = seen(chart, layout);
    found.forEach((line, i) => Object.assign(data[traces[i]], line));
    if (held.get(chart).hasPeaks) {
      const { 'yaxis.range': range, annotations } = ordinate(chart, found, isWhole(chart, view));
      Object.assign(layout, { annotations });
      if (range) layout.yaxis.range = range;
    }
    name(chart, { data, layout }, layout.xaxis.range);
    paint(data, layout);
    if (isTouched) layout.dragmode = false;
    Plotly.newPlot(chart, data, layout, config);
    link(chart);
    charts.push(chart);
    if (isOverTime) {
      overTime.push(chart);
      cursor.attach(chart, (each) => held.get(each));
    } else if (layout.meta?.robot) {
      replay.attach(chart, layout.meta.robot, cursor.show);
    }
  };
  const redraw = (chart, change, keepsOrdinate) => {
    const range = change['xaxis.range'] ?? chart.layout.xaxis.range;
    const { isOverTime, traces } = held.get(chart);
    const found = seen(chart, isOverTime ? { xaxis: { range } } : chart.layout);
    const line = Object.fromEntries(
      ['x', 'y', 'fill'].map((key) => [key, found.map((each) => each[key])]),
    );
    const follows = isOverTime && !keepsOrdinate;
    const ordinates = follows ? ordinate(chart, found, isWhole(chart, range)) : {};
    if (isOverTime) name(chart, chart, range);
    return Plotly.update(chart, line, { ...change, ...ordinates }, traces);
  };

  let isLinking = false;
  const link = (chart) =>
    chart.on('plotly_relayout', async (changed) => {
      const keys = Object.keys(changed);
      if (isLinking || !keys.some((key) => /^[xy]axis/.test(key))) return;
      const isOverTime = overTime.includes(chart);
      if (isOverTime && !keys.some((key) => key.startsWith('xaxis'))) return;
      isLinking = true;
      const range = [...chart.layout.xaxis.range];
      if (isOverTime) view = range;
      const others = isOverTime ? overTime.filter((other) => other !== chart) : [];
      // A box that the user drew has an ordinate; a whole run has that of its first drawing.
      const keepsOrdinate =
        keys.some((key) => key.startsWith('yaxis')) && !(isOverTime && isWhole(chart, range));
      await Promise.all([
        redraw(chart, {}, keepsOrdinate),
        ...others.map((other) => redraw(other, { 'xaxis.range': [...range] }, false)),
      ]);
      isLinking = false;
    });

  const repaint = () => {
    for (const chart of charts) {
      paint(chart.data, chart.layout);
      Plotly.redraw(chart);
    }
  };
  // The page answers in between.
  const pause = () => new Promise((go) => setTimeout(go));
  const NEAR = 600; // Pixels from the window.
  const near = new IntersectionObserver(
    (entries) => {
      for (const { target, isIntersecting } of entries) {
        if (!isIntersecting) continue;
        near.unobserve(target);
        pause().then(() => undrawn.has(target) && draw(target));
      }
    },
    { rootMargin: `${NEAR}px 0px` },
  );
  // Plots at the top first.
  const add = async (added) => {
    for (const chart of added) {
      await prepare(chart);
      await pause();
      const { top, bottom } = chart.getBoundingClientRect();
      if (top >= innerHeight || bottom <= 0) near.observe(chart);
      else if (undrawn.has(chart)) draw(chart);
    }
    document.documentElement.dataset.drawn = charts.length;
  };
  const open = async (details) => {
    const packed = details.querySelector(':scope > script');
    if (!details.open || !packed) return;
    packed.remove();
    const content = details.querySelector('.content');
    content.innerHTML = await inflate(packed.textContent);
    await ready;
    await add(content.querySelectorAll('.plot'));
  };
  for (const details of document.querySelectorAll('details.run')) {
    details.addEventListener('toggle', () => open(details));
  }
  const follow = () => {
    const run = document.getElementById(location.hash.slice(1))?.closest('details.run');
    if (run) run.open = true;
    run?.scrollIntoView();
  };
  addEventListener('hashchange', follow);
  const ready = library.then(async () => {
    const trend = document.getElementById('trend');
    if (trend) {
      await trends.draw(trend, { paint, config });
      charts.push(trend);
    }
    await add(document.querySelectorAll('.plot:not(#trend)'));
  });
  follow();
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', repaint);

  // Printed drawings are as wide as the paper permits, with the colours of the light page.
  const print = (isPrinted) => {
    if (!document.documentElement.dataset.drawn) return;
    document.documentElement.classList.toggle('printed', isPrinted);
    [...undrawn.keys()].forEach(draw);
    repaint();
    for (const chart of charts) {
      const { width, height } = chart._fullLayout;
      chart.style.setProperty('--ratio', width / height);
      for (const svg of chart.querySelectorAll('.main-svg')) {
        svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
      }
    }
  };
  addEventListener('beforeprint', () => print(true));
  addEventListener('afterprint', () => print(false));
})();
