'use strict';
// Plotly, which the page contains in compressed form; ready when it can draw.
const library = (async () => {
  const text = document.getElementById('plotly').textContent;
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  const script = document.createElement('script');
  script.textContent = await new Response(stream).text();
  document.head.append(script);
  script.remove();
})();
