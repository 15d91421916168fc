// Sorts the table of a study's points, and the pictures with it; shows one response or all; names the points in plots.
'use strict';
(() => {
  const table = document.querySelector('table.points');
  if (!table) return;
  const body = table.tBodies[0];
  const said = document.getElementById('sorted');
  const heads = [...table.tHead.rows[0].cells];
  const rows = [...body.rows];
  const places = new Map([...document.querySelectorAll('article.point')].map((a) => [a.id, a]));
  rows.forEach((row, i) => { row.dataset.order = i; });

  const key = (row, column) => {
    const cell = row.cells[column];
    const text = cell.textContent.trim();
    if (cell.dataset.value !== undefined) return Number(cell.dataset.value);
    if (cell.classList.contains('none') || text === '') return null;
    // The first column is the name of a point: by it the order of the study comes back.
    return column === 0 ? Number(row.dataset.order) : text;
  };
  const order = (a, b) => (typeof a === 'number' && typeof b === 'number' ? a - b : String(a).localeCompare(String(b), 'en'));

  function sort(column) {
    const head = heads[column];
    const down = head.getAttribute('aria-sort') === 'ascending';
    for (const h of heads) h.removeAttribute('aria-sort');
    head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
    const keyed = rows.map((row) => [key(row, column), row]);
    keyed.sort(([a, x], [b, y]) => {
      // What has no value comes last, both ways.
      if (a === null || b === null) return (a === null) - (b === null) || x.dataset.order - y.dataset.order;
      return (down ? -1 : 1) * order(a, b) || x.dataset.order - y.dataset.order;
    });
    for (const [, row] of keyed) {
      body.append(row);
      const place = places.get(row.dataset.place);
      place?.parentElement.append(place);
    }
    said.textContent = `Sorted by ${head.textContent.trim()}, ${down ? 'descending' : 'ascending'}.`;
  }

  heads.forEach((head, column) => {
    const button = document.createElement('button');
    button.type = 'button';
    button.className = 'sort';
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener('click', () => sort(column));
  });

  // A mark in a plot tells its point, once it is pointed at.
  const names = new Map(rows.map((row) => [`#${row.dataset.place}`, row]));
  for (const mark of document.querySelectorAll('#responses a[href^="#"]')) {
    if (!mark.ownerSVGElement) continue;
    mark.addEventListener('pointerenter', () => {
      if (mark.querySelector('title')) return;
      const row = names.get(mark.getAttribute('href'));
      if (!row) return;
      const title = document.createElementNS(mark.namespaceURI, 'title');
      const cells = [...row.cells].slice(1).map((cell, i) => `${heads[i + 1].textContent.trim()}: ${cell.textContent.trim()}`);
      title.textContent = [row.cells[0].textContent.trim(), ...cells].join('\n');
      mark.append(title);
    });
  }

  const chosen = document.getElementById('response');
  const responses = [...document.querySelectorAll('section.response')];
  chosen?.addEventListener('change', () => {
    for (const r of responses) r.hidden = chosen.value !== '' && r.dataset.response !== chosen.value;
  });
})();
