"""Print the JSON Schema of a scene file: `python -m scene > docs/scene.schema.json`."""

import json

from scene.load import json_schema

if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=2, ensure_ascii=False))
