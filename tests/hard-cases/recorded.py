"""Rows whose numbers stand in a record, because they take longer than a table may: read from its tables, not measured here."""

import runs

FOLDER = runs.ROOT / "docs" / "records"


def read(record: str, rows: list) -> None:
    """Puts into every row what the record's table of that heading says of its element, over all laws."""
    lines = (FOLDER / f"{record}.md").read_text().splitlines()
    for row in rows:
        laws = [law for law in table(lines, row.table) if law["element"] == f"`{row.element}`"]
        row.results = {
            "laws": len(laws),
            "patches": sum(int(law["patches"]) for law in laws),
            "patches_least": min(int(law["patches"]) for law in laws),
            "above": sum(int(law["above"]) for law in laws),
            "median_least": min(float(law["median"]) for law in laws),
            "median_largest": max(float(law["median"]) for law in laws),
            "lowest_5_percent_least": min(float(law["5 %"]) for law in laws),
            "lowest_5_percent_largest": max(float(law["5 %"]) for law in laws),
        }


def table(lines: list[str], heading: str) -> list[dict[str, str]]:
    """The table under a heading, a row by the names of its columns."""
    begin = lines.index(f"## {heading}") + 1
    end = next((i for i in range(begin, len(lines)) if lines[i].startswith("## ")), len(lines))
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[begin:end] if line.startswith("| ")]
    # A section may have another table below: that with as many columns as the first is meant.
    return [dict(zip(rows[0], row)) for row in rows[1:] if len(row) == len(rows[0])]
