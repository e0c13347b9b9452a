// SPDX-License-Identifier: Apache-2.0
// Excerpts of search results without the sources of formulas, figures and scripts.
addEventListener('DOMContentLoaded', () => {
  if (typeof Search === 'undefined') return;
  const toText = Search.htmlToText;
  Search.htmlToText = (html, anchor) => {
    const page = new DOMParser().parseFromString(html, 'text/html');
    page.querySelectorAll('.katex-mathml, .law-figure, .mermaid, nav').forEach((part) => part.remove());
    return toText(page.documentElement.outerHTML, anchor);
  };
});
