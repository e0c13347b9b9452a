'use strict';
// A metric of many runs over a parameter in which they differ; another one sets the colours.
const trends = (() => {
  const SYMBOLS = ['circle', 'square', 'diamond', 'cross', 'x', 'triangle-up', 'star'];
  const NAMED = 14; // Maximum number of values with a legend.
  const WIDE = 30; // Ratio of parameters from which their axis is logarithmic.

  const traces = ({ runs, links, colours }, metric, parameter, group) => {
    const members = new Map();
    runs.forEach((_, i) => {
      const text = group?.texts[i] ?? '';
      if (parameter.values[i] === null || metric.values[i] === null) return;
      members.set(text, [...(members.get(text) ?? []), i]);
    });
    const { compare } = new Intl.Collator('en', { numeric: true });
    return [...members].sort(([a], [b]) => compare(a, b)).map(([text, places], k) => {
      places.sort((a, b) => parameter.values[a] - parameter.values[b]);
      const x = places.map((i) => parameter.values[i]);
      // Several runs with one value differ in other parameters: a line would join those.
      const isLine = new Set(x).size === x.length && x.length > 1;
      return {
        x,
        y: places.map((i) => metric.values[i]),
        name: text && `${group.name} ${text}`,
        mode: isLine ? 'lines+markers' : 'markers',
        line: { width: 1 },
        marker: { size: 8, symbol: SYMBOLS[Math.floor(k / colours.length) % SYMBOLS.length] },
        meta: colours[k % colours.length],
        customdata: places.map((i) => links[i]),
        text: places.map((i) => runs[i].replaceAll('&', '&amp;').replaceAll('<', '&lt;')),
        hovertemplate: `%{text}<br>${parameter.name} %{x}: %{y:.3~g}<extra></extra>`,
      };
    });
  };

  const fill = (select, entries, chosen) => {
    entries.forEach(({ name }, i) => select.add(new Option(name, i)));
    select.value = Math.max(chosen, 0);
  };

  const draw = async (chart, { paint, config }) => {
    const content = JSON.parse(document.getElementById('trend-data').textContent);
    const { metrics, parameters, groups } = content;
    const [metric, parameter, group] = ['metric', 'parameter', 'group'].map((name) =>
      document.getElementById(`trend-${name}`));
    fill(metric, metrics, 0);
    fill(parameter, parameters, 0);
    const law = groups.findIndex(({ name }) => name === 'law');
    fill(group, groups, law >= 0 ? law : groups.findIndex(({ name }) => name !== parameters[0].name));
    const show = () => {
      const [y, x] = [metrics[metric.value], parameters[parameter.value]];
      const other = groups[group.value];
      const data = traces(content, y, x, other.name === x.name ? null : other);
      const numbers = x.values.filter((value) => value !== null);
      const isWide = Math.min(...numbers) > 0 && Math.max(...numbers) > WIDE * Math.min(...numbers);
      const layout = {
        margin: { l: 64, r: 12, t: 32, b: 48 },
        font: { size: 13 },
        hovermode: 'closest',
        showlegend: data.length > 1 && data.length <= NAMED,
        legend: { orientation: 'h', x: 0, y: 0, yref: 'container' },
        xaxis: { title: { text: x.name }, automargin: true, type: isWide ? 'log' : 'linear' },
        yaxis: { title: { text: y.name }, automargin: true, rangemode: 'tozero' },
      };
      paint(data, layout);
      return Plotly.react(chart, data, layout, config);
    };
    for (const select of [metric, parameter, group]) select.addEventListener('change', show);
    await show();
    chart.on('plotly_click', ({ points }) => {
      location.hash = points[0].customdata;
    });
  };

  return { draw };
})();
