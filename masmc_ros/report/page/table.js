'use strict';
// Tables whose rows are sorted by a column, at a click on its head or by the keyboard.
(() => {
  // Numbers in texts are compared by value: a gain of 10 follows a gain of 2.
  const { compare } = new Intl.Collator('en', { numeric: true });
  const isNumber = (key) => key !== '' && !Number.isNaN(Number(key.replace('inf', 'Infinity')));
  const order = (a, b) => {
    if (isNumber(a) && isNumber(b)) {
      return Number(a.replace('inf', 'Infinity')) - Number(b.replace('inf', 'Infinity'));
    }
    return compare(a, b);
  };
  const sort = (table, column, isDescending) => {
    const key = (row) => row.cells[column].dataset.key;
    const rows = [...table.tBodies[0].rows];
    const missing = rows.filter((row) => key(row) === '');
    const known = rows.filter((row) => key(row) !== '');
    known.sort((a, b) => (isDescending ? order(key(b), key(a)) : order(key(a), key(b))));
    table.tBodies[0].append(...known, ...missing);
  };
  for (const table of document.querySelectorAll('table.sortable')) {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => {
      head.querySelector('button').addEventListener('click', () => {
        const isDescending = head.getAttribute('aria-sort') === 'ascending';
        for (const other of heads) other.removeAttribute('aria-sort');
        head.setAttribute('aria-sort', isDescending ? 'descending' : 'ascending');
        sort(table, column, isDescending);
      });
    });
  }
})();
