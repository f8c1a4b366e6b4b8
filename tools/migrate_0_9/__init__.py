"""From format 0.9 to 1.0: ``python -m tools.migrate_0_9 --python-0-9 PYTHON OLD.mcz NEW.mcz``."""
