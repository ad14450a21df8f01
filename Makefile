# The few commands; each is a script or one line. See CONTRIBUTING.md.
.DEFAULT_GOAL := help
.PHONY: help setup demo quick test long lint format docs bench constants fingerprint

help: ## this list
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

setup: ## build the wheel and install it in .venv
	scripts/setup
demo: ## track the bundled recording
	scripts/demo
quick: ## build what changed, test what matters: make quick TESTS="terms tests/test_api.py"
	scripts/quick $(TESTS)
test: ## every test
	scripts/test
long: ## every test, the long ones too
	scripts/test --long
lint: ## rustfmt, clippy, ruff, mypy, the order of imports
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets -- -D warnings
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy
	.venv/bin/lint-imports
format: ## set the code
	cargo fmt --all
	.venv/bin/ruff format .
docs: ## build the documentation
	scripts/docs
bench: ## time a step and a closest point
	cargo bench --locked -p voodoo-benches
constants: ## the numbers by which voodoo decides
	scripts/constants
fingerprint: ## the same bits as OLD? make fingerprint OLD=main
	scripts/fingerprint "$(OLD)" .
