"""How Sphinx makes the manual of these pages. scripts/docs calls it, with the pages that it has put together and with the version in the
environment."""
import os
import re

from sphinx.addnodes import toctree

project = "rhec"
version = release = os.environ.get("RHEC_VERSION", "")
copyright = author = "the authors of rhec"
extensions = ["myst_parser", "sphinx.ext.autodoc"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
myst_heading_anchors = 4
smartquotes = False  # two dashes are those of an option
myst_enable_extensions = ["deflist"]
suppress_warnings = ["myst.header", "misc.highlighting_failure"]  # pages of rooms begin where their folder is; grammars are no code
highlight_language = "none"
primary_domain = None
autodoc_member_order = "bysource"
autodoc_typehints = "signature"

html_extra_path = ["extra"]
html_theme = "furo"
html_title = f"rhec {version}"
html_show_copyright = html_show_sphinx = html_show_sourcelink = False
html_copy_source = False
html_theme_options = {"light_css_variables": {"color-brand-primary": "#1f6f8b", "color-brand-content": "#1f6f8b"},
                      "dark_css_variables": {"color-brand-primary": "#7fc4d9", "color-brand-content": "#7fc4d9"}}


def as_markup(paragraph):
    """A paragraph of a docstring as reStructuredText. Docstrings are plain: `name: meaning` on a line is an item of a list, and what is
    indented by four belongs to the line before it, or is code where all of it is."""
    if all(line.startswith("    ") for line in paragraph):
        return ["::", "", *paragraph]
    items = []
    for line in paragraph:
        if items and line.startswith("    "):
            items[-1] += " " + line.strip()
        else:
            items.append(line.strip())
    if all(ITEM.match(item) for item in items):
        return [f"- ``{ITEM.match(item)[1]}``: {escaped(ITEM.sub('', item, count=1))}" for item in items]
    return [escaped(item) for item in items]


ITEM = re.compile(r"^(\w+(?:, \w+)*): ")


def escaped(text):
    """Everything as it is, but for what stands in backquotes, which is code."""
    parts = re.split(r"`([^`]+)`", text)
    return "".join(f"``{part}``" if i % 2 else re.sub(r"([*|_\\`])", r"\\\1", part) for i, part in enumerate(parts))


def plain_docstring(app, what, name, value, options, lines):
    paragraphs, current = [], []
    for line in [*lines, ""]:
        if line.strip():
            current.append(line)
        elif current:
            paragraphs.append(current)
            current = []
    lines[:] = [line for paragraph in paragraphs for line in [*as_markup(paragraph), ""]]


def with_titles_alone(builder):
    """The navigation beside each page shows titles of pages, and no headings within them. Sphinx copies all headings of all pages for
    each page before it leaves them out, which took half of the whole time; here they are left out once."""
    of_builder, titles = builder._get_local_toctree, {}

    def titles_of(contents):
        contents = contents.deepcopy()
        for top in contents:
            if len(top) > 1:
                inner = list(top.findall(toctree))
                if inner:
                    top[1][:] = inner
                else:
                    top.pop(1)
        return contents

    def local_toctree(docname, collapse=True, **options):
        whole = builder.env.tocs
        if not options.get("titles_only"):
            return of_builder(docname, collapse, **options)
        if not titles:
            titles.update({document: titles_of(contents) for document, contents in whole.items()})
        builder.env.tocs = titles
        try:
            return of_builder(docname, collapse, **options)
        finally:
            builder.env.tocs = whole

    builder._get_local_toctree = local_toctree


def setup(app):
    app.connect("autodoc-process-docstring", plain_docstring)
    app.connect("builder-inited", lambda app: with_titles_alone(app.builder) if hasattr(app.builder, "_get_local_toctree") else None)
