"""Reports: data, drawings, and one template for typst."""
