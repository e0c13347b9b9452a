'use strict';
// The text of base64 of gzip.
const inflate = async (text) => {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Response(stream).text();
};
// Plotly, which the page contains in compressed form; ready when it can draw.
const library = (async () => {
  const script = document.createElement('script');
  script.textContent = await inflate(document.getElementById('plotly').textContent);
  document.head.append(script);
  script.remove();
})();
