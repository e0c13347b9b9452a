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
  const draw = (chart) => {
    const { data, layout } = JSON.parse(document.getElementById(`${chart.id}-data`).textContent);
    paint(data, layout);
    if (isTouched) layout.dragmode = false;
    return Plotly.newPlot(chart, data, layout, config);
  };

  let isLinking = false;
  const link = (chart) =>
    chart.on('plotly_relayout', async (changed) => {
      if (isLinking || !Object.keys(changed).some((key) => key.startsWith('xaxis'))) return;
      isLinking = true;
      const others = overTime.filter((other) => other !== chart);
      const range = [...chart.layout.xaxis.range];
      await Promise.all(others.map((other) => Plotly.relayout(other, { 'xaxis.range': [...range] })));
      isLinking = false;
    });

  Promise.all(charts.map(draw)).then(() => {
    overTime.forEach(link);
    document.documentElement.dataset.drawn = charts.length;
  });
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
    for (const chart of charts) {
      paint(chart.data, chart.layout);
      Plotly.redraw(chart);
    }
  });
})();
