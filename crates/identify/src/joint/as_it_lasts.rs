//! What one forecast step tells as it lasts longer: its rows are gone through once, instead of once for each time at which it may
//! end.
//!
//! The model is linearised about the step that lasts longest. A step that ends earlier has the first of the same rows, so that its
//! products of derivatives are sums that grow row by row; what differs is the end, which the efficiency is that of. The surface
//! counts from there, and derivatives by its coefficients follow from that by the efficiency.

use crate::dynamic::Estimate;
use crate::joint::model::surface_of;
use crate::joint::parameters::{ETA, FLOW_GAIN, LOCAL, OFFSETS, SHARED, SLOPE, SURFACE};
use crate::joint::rows::{End, StepRows};
use crate::joint::solve::Fisher;
use crate::joint::start;
use crate::joint::surface::{TERM_COUNT, dot};
use crate::joint::worth::StepWorth;
use nalgebra::{DMatrix, Matrix4, Matrix4xX};

/// Sums of products of the derivatives, those of the step itself behind those by what is shared.
struct Products(DMatrix<f64>);

impl Products {
    fn add(&mut self, row: &[f64]) {
        for (i, a) in row.iter().enumerate() {
            for (j, b) in row.iter().enumerate().skip(i) {
                self.0[(i, j)] += a * b;
            }
        }
    }

    /// The sums with so many times the column `of` added to others, in full.
    fn with_added(&self, of: usize, times: &[f64]) -> DMatrix<f64> {
        let mut all = self.0.clone();
        all.fill_lower_triangle_with_upper_triangle();
        for (to, factor) in times.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
            let added = *factor * all.column(of);
            let mut column = all.column_mut(to);
            column += added;
        }
        for (to, factor) in times.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
            let added = *factor * all.row(of);
            let mut row = all.row_mut(to);
            row += added;
        }
        all
    }
}

impl StepWorth {
    /// What a step tells with each of these ends, the earliest first, where the campaign's shared numbers stand. `about`: where its
    /// own ones do.
    pub(crate) fn fisher_at_ends(
        &self,
        rows: &[StepRows; 1],
        about: &Estimate,
        ends: &[End],
    ) -> Vec<Option<Fisher>> {
        let [step] = rows;
        let problem = self.alone(rows, about);
        let Some(member) = problem.members.first() else { return vec![None; ends.len()] };
        let unknown = problem.unknown();
        let mut wanted = [false; SHARED];
        unknown.iter().for_each(|index| wanted[*index] = true);
        let (_, columns) = problem.residual(member, &problem.shared, &member.local, Some(&wanted));
        let own = (0..LOCAL).map(|i| SHARED + i);
        let columns: Vec<&Vec<f64>> =
            unknown.iter().copied().chain(own).filter_map(|index| columns.get(index)).collect();
        let (shared, all) = (unknown.len(), unknown.len() + LOCAL);
        if columns.len() != all || columns.iter().any(|column| column.len() != step.rows.len()) {
            return vec![None; ends.len()];
        }
        let scale = self.scale();
        let last_terms = scale.terms(step.end.place);
        let mut products = Products(DMatrix::zeros(all, all));
        let (mut counted, mut row) = (0, vec![0.0; all]);
        let mut at = |end: &End| {
            for i in counted..end.rows.min(step.rows.len()) {
                row.iter_mut().zip(&columns).for_each(|(cell, column)| *cell = column[i]);
                products.add(&row);
            }
            counted = counted.max(end.rows);
            let terms = scale.terms(end.row.place);
            let closer: [f64; TERM_COUNT] = std::array::from_fn(|k| last_terms[k] - terms[k]);
            let mut times = vec![0.0; all];
            for (time, index) in times.iter_mut().zip(&unknown).filter(|(_, index)| **index >= SURFACE) {
                *time = member.local[SLOPE] * closer[*index - SURFACE];
            }
            times[shared + SLOPE] = dot(&closer, surface_of(&problem.shared));
            let sums = products.with_added(shared + ETA, &times);
            let mut coupling = member.coupling;
            coupling[SURFACE..].copy_from_slice(&terms);
            let slopes = problem.setting.sensitivities(&end.row, &problem.shared, &member.local);
            let by_eta = problem.setting.by_efficiency(&end.row, &problem.shared, &member.local);
            if let Some(coupled) = start::coupled(&slopes, by_eta).filter(|_| problem.setting.shaped) {
                coupling[OFFSETS..FLOW_GAIN].copy_from_slice(&coupled);
            }
            let mut own: Matrix4<f64> = sums.fixed_view::<LOCAL, LOCAL>(shared, shared).into_owned();
            let mut mixed: Matrix4xX<f64> = sums.fixed_rows::<LOCAL>(shared).columns(0, shared).into_owned();
            let mut information = sums.view((0, 0), (shared, shared)).into_owned();
            problem.add_known(member, &coupling, &unknown, &mut own, &mut mixed);
            problem.add_surface(&coupling, &unknown, &mut information);
            let inverse = own.cholesky()?.inverse();
            let answer = -(inverse * &mixed);
            information += mixed.transpose() * &answer;
            let steps = vec![(inverse[(ETA, ETA)], answer.row(ETA).transpose())];
            Some(Fisher { unknown: unknown.clone(), information, steps })
        };
        ends.iter().map(&mut at).collect()
    }
}
