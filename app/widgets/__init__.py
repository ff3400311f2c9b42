"""Widgets that several pages share: fields, forms, tables, dialogs, theme and icons."""
