"""Files: written whole or not at all (`writer`), and as tables in CSV and Parquet (`tables`).

They stand in `scene` because every package may import it. Nothing here knows what a file is about.
"""
