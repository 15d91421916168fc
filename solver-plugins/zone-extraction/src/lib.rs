//! plyflow-zone-extraction
