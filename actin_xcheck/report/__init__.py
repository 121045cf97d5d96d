"""What pages are made of: exhibits, drawings, tables, films, the environment of their templates."""
