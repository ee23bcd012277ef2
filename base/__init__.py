"""What every layer stands on: errors, arguments, messages, names, tables, pages, files,
progress."""
