// Joins the tables of defects with the maps and the 3D view: one defect is selected at a time. Copies the command.
'use strict';
(() => {
  const all = (selector) => [...document.querySelectorAll(selector)];
  // Only what has a place on a map can be shown.
  const known = new Set(all('g.place').map((g) => g.dataset.defect));
  const marks = all('[data-defect]').filter((e) => known.has(e.dataset.defect));
  const rows = marks.filter((e) => e.tagName === 'TR');
  let selected = null;

  function select(id, from) {
    selected = id;
    for (const mark of marks) mark.classList.toggle('lit', mark.dataset.defect === id);
    for (const row of rows) row.setAttribute('aria-selected', String(row.dataset.defect === id));
    const row = rows.find((r) => r.dataset.defect === id);
    // From the map to its row; from the table the view comes into sight by itself.
    if (row && from !== row && from?.tagName !== 'TR') row.scrollIntoView({ block: 'nearest' });
    document.dispatchEvent(new CustomEvent('plyflow-defect', { detail: { id, scroll: from?.tagName === 'TR' } }));
  }

  for (const mark of marks) {
    mark.classList.add('selectable');
    mark.addEventListener('click', () => {
      const id = mark.dataset.defect;
      // What was dragged over to copy text was not meant.
      if (String(getSelection()) === '') select(id === selected ? null : id, mark);
    });
  }
  for (const row of rows) {
    row.tabIndex = 0;
    row.addEventListener('keydown', (event) => {
      if (event.key !== 'Enter' && event.key !== ' ') return;
      event.preventDefault();
      select(row.dataset.defect, row);
    });
  }
  document.addEventListener('plyflow-nothing', () => select(null));
  document.addEventListener('keydown', (event) => {
    if (event.key === 'Escape' && selected !== null) select(null);
  });

  for (const text of all('.with-script')) text.hidden = false;
  for (const button of all('button.copy')) {
    button.addEventListener('click', async () => {
      const code = button.parentElement.querySelector('code');
      try {
        await navigator.clipboard.writeText(code.textContent);
        button.textContent = 'Copied';
      } catch {
        // Without the right to write to the clipboard: selected, so that Ctrl+C takes it.
        getSelection().selectAllChildren(code);
        button.textContent = 'Press Ctrl+C';
      }
      setTimeout(() => { button.textContent = 'Copy'; }, 2000);
    });
  }
})();
